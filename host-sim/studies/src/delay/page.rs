//! The page: one self-contained file in the style of a run's report.

use minijinja::{Value, context};

use super::trial::{Law, Start};
use super::{PAPER_BAND_S, PAPER_DELAY_S, Study};
use crate::StudyError;
use wheeleg_report::{page, pictures, plot::Figure};

const TEMPLATE: &str = include_str!("page.html");

/// Seconds in milliseconds.
const DIGITS: usize = 3;

fn seconds(value: f64) -> String {
    let text = format!("{value:.DIGITS$}");
    // No minus sign on zero.
    let text = if text.trim_start_matches(['-', '0', '.']).is_empty() {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    };
    text.replace('-', "−")
}

fn maybe(value: Option<f64>) -> String {
    value.map_or_else(|| "never".to_owned(), seconds)
}

/// In one sentence each: where the paper's delay is reached, and where not.
pub(super) fn findings(study: &Study) -> Vec<String> {
    let band = PAPER_DELAY_S - PAPER_BAND_S..=PAPER_DELAY_S + PAPER_BAND_S;
    let mut list = Vec::new();
    for law in Law::ALL {
        let named = |inside: bool| {
            let of = study.starts.list.iter().filter(|d| d.law == law);
            let names: Vec<String> = of
                .filter(|d| band.contains(&d.median_s) == inside)
                .map(|d| format!("{} {} s", d.start.name(), seconds(d.median_s)))
                .collect();
            if names.is_empty() {
                "none".to_owned()
            } else {
                names.join("; ")
            }
        };
        list.push(format!(
            "{} law (medians): within 0.25 ± 0.05 s: {}. Outside: {}.",
            match law {
                Law::Paper => "Paper's",
                Law::Default => "Default",
            },
            named(true),
            named(false)
        ));
    }
    let a = &study.ablation;
    list.push(format!(
        "Filling and venting of the chambers make {:.0} % of the {} s that pass from the command in the master to the first millimetre; without them {} s are left.",
        1e2 * a.swap_share,
        seconds(a.base_s),
        seconds(a.without_swap_s)
    ));
    for start in [Start::HomeHeld, Start::HomeRest] {
        let last = study.notice.of(Law::Default, start).last();
        list.push(match (study.notice.enough_s(start), last) {
            (Some(0.0), Some(last)) => format!(
                "Default law, {}: it starts within {} s without any notice; with 0.4 s within {} s.",
                start.name(),
                super::NOTICED_LIMIT_S,
                maybe(last.delay_s)
            ),
            (Some(notice_s), _) => format!(
                "Default law, {}: announced {notice_s} s before or earlier, it starts within {} s, and has not moved 1 mm before.",
                start.name(),
                super::NOTICED_LIMIT_S
            ),
            (None, last) => format!(
                "Default law, {}: no notice up to 0.4 s brings every start within {} s; with 0.4 s the median is {} s and the worst {} s.",
                start.name(),
                super::NOTICED_LIMIT_S,
                maybe(last.and_then(|l| l.median_s)),
                maybe(last.and_then(|l| l.delay_s))
            ),
        });
    }
    list
}

pub(super) fn render(study: &Study, figures: &[(Figure, String)]) -> Result<String, StudyError> {
    let starts: Vec<Value> = Start::ALL
        .into_iter()
        .map(|start| {
            let cells: Vec<Value> = Law::ALL
                .into_iter()
                .filter_map(|law| study.starts.of(law, start))
                .map(|d| {
                    context! {
                        min => seconds(d.min_s),
                        median => seconds(d.median_s),
                        p90 => seconds(d.p90_s),
                        max => seconds(d.max_s),
                        never => d.never,
                        a => format!("{:.1}", d.pressure_pa[0] * 1e-5),
                        b => format!("{:.1}", d.pressure_pa[1] * 1e-5),
                    }
                })
                .collect();
            context! { name => start.name(), text => start.text(), cells => cells }
        })
        .collect();
    let a = &study.ablation;
    let rows: Vec<Value> = a
        .rows
        .iter()
        .map(|r| {
            context! {
                id => r.id,
                text => r.text,
                alone => seconds(r.alone_s),
                contribution => seconds(r.contribution_s),
                series => seconds(r.series_s),
                step => seconds(r.step_s),
            }
        })
        .collect();
    let variations: Vec<Value> = a
        .variations
        .iter()
        .map(|v| {
            context! {
                id => v.id,
                text => v.text,
                delay => maybe(v.delay_s),
                difference => v.difference_s.map_or_else(String::new, seconds),
            }
        })
        .collect();
    let predictions: Vec<Value> = study
        .predictions
        .list
        .iter()
        .map(|p| {
            let rival = p.id.starts_with("rival");
            context! {
                id => p.id,
                statement => &*p.statement,
                measured => p.measured.replace('-', "−"),
                verdict => match (rival, p.holds) {
                    (false, true) => "holds",
                    (false, false) => "does not hold",
                    (true, false) => "ruled out",
                    (true, true) => "not ruled out",
                },
                class => if p.holds == rival { "fail" } else { "pass" },
            }
        })
        .collect();
    let notices: Vec<Value> = study
        .notice
        .rows
        .iter()
        .map(|r| {
            context! {
                law => r.law.name(),
                start => r.start.name(),
                load => format!("{:+.0}", r.load_n).replace('-', "−"),
                notice => r.notice_s,
                median => maybe(r.median_s),
                delay => maybe(r.delay_s),
                early => format!("{:.2}", r.early_mm),
                meets => r.meets(),
            }
        })
        .collect();
    let home = |law| {
        study
            .starts
            .of(law, Start::HomeHeld)
            .map_or(f64::NAN, |d| d.median_s)
    };
    let announced = |start| study.notice.of(Law::Default, start).last().cloned();
    let (noticed, noticed_rest) = (announced(Start::HomeHeld), announced(Start::HomeRest));
    let band = PAPER_DELAY_S - PAPER_BAND_S..=PAPER_DELAY_S + PAPER_BAND_S;
    let values = context! {
        version => env!("CARGO_PKG_VERSION"),
        robot => &*study.robot,
        hash => &*study.robot_hash,
        seeds => study.seeds,
        mass => study.mass_kg,
        load => study.load_n,
        figures => pictures(figures),
        findings => findings(study),
        starts => starts,
        base => seconds(a.base_s),
        ablation_seeds => a.seeds,
        rows => rows,
        residual => seconds(a.residual_s),
        sum => seconds(a.sum_s),
        whole => seconds(a.base_s - a.residual_s),
        interaction => seconds(a.interaction_s),
        without_swap => seconds(a.without_swap_s),
        swap => format!("{:.0}", 1e2 * a.swap_share),
        variations => variations,
        predictions => predictions,
        notices => notices,
        paper_home => seconds(home(Law::Paper)),
        paper_reached => band.contains(&home(Law::Paper)),
        default_home => seconds(home(Law::Default)),
        noticed => maybe(noticed.as_ref().and_then(|n| n.delay_s)),
        noticed_meets => noticed.is_some_and(|n| n.meets()),
        noticed_rest => maybe(noticed_rest.as_ref().and_then(|n| n.delay_s)),
        noticed_rest_meets => noticed_rest.is_some_and(|n| n.meets()),
        cycle_ms => 1e3 * study.bus.cycle_s,
        frame_ms => format!("{:.2}", 1e3 * study.bus.frame_s),
    };
    Ok(page(TEMPLATE, values)?)
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn small_numbers_have_no_sign_and_large_ones_have_the_right_one() {
        assert_eq!(seconds(-0.0001), "0.000");
        assert_eq!(seconds(-0.0123), "−0.012");
        assert_eq!(seconds(0.2018), "0.202");
    }
}
