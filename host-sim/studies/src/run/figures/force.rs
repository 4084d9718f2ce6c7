//! Fig. 16: the force F6 on the vertical cylinder, and why the model's is larger in a push.

use super::Source;
use crate::analysis::within;
use wheeleg_config::LegChoice;
use wheeleg_report::number::fixed;
use wheeleg_report::plot::{Content, Figure, colour, line};

/// Time after the start of a push in which the landed foot settles, s.
const SETTLED_S: f64 = 0.2;
/// A foot with less load than this does not stand, N.
const STANDS_N: f64 = 1.0;
/// Allowed residual of the balance of forces, N: the foot's friction and its bearings.
const BALANCED_N: f64 = 1.5;

/// Means over all pushes, N.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Push {
    /// F6 of the simulated robot.
    simulated_n: f64,
    /// F6 of the reference model.
    model_n: f64,
    /// Load of the stepping foot in the model.
    model_load_n: f64,
    /// Load of the stepping foot.
    stepping_n: f64,
    /// Load of the other foot.
    other_n: f64,
    /// Weight of the parts that b6 moves.
    weight_n: f64,
}

impl Push {
    /// `None` if there is no reference model, or no whole push in the record.
    fn of(s: &Source<'_>, b6: usize) -> Option<Self> {
        let model = s.analysis.reference.as_ref()?;
        let (gait, start_s) = (&s.robot.gait, s.analysis.start_s);
        let pushes: Vec<(f64, f64)> = (0..gait.steps)
            .map(|step| {
                let from_s = start_s + f64::from(step) * gait.period_s;
                (from_s + gait.push_s + SETTLED_S, from_s + gait.period_s)
            })
            .collect();
        let stepping = usize::from(s.analysis.leg == Some(LegChoice::Right));
        let feet = [stepping, 1 - stepping].map(|foot| {
            let rows = s.recording.feet[foot].iter();
            let pushed = rows.filter(|r| pushes.iter().any(|p| within(r, p.0, p.1)));
            mean(pushed.map(|r| r.v.normal_force_n))
        });
        let forces = || {
            let rows = s.recording.joints[b6].iter();
            rows.filter(|r| pushes.iter().any(|p| within(r, p.0, p.1)))
        };
        let modelled = || forces().map(|r| model.at(r.t_s() - start_s));
        Some(Self {
            simulated_n: mean(forces().map(|r| r.v.force_net_n))?,
            model_n: mean(modelled().map(|p| p.f6_n))?,
            model_load_n: mean(modelled().map(|p| p.load_n))?,
            stepping_n: feet[0]?,
            other_n: feet[1]?,
            weight_n: s.robot.reference.m6_kg * s.robot.reference.gravity_m_s2,
        })
    }

    /// The explanation of the difference, if these numbers support it: both feet stand, and F6 is the foot's
    /// load less the weight.
    fn explained(&self) -> Option<String> {
        let rest_n = self.stepping_n - self.weight_n;
        let balanced = (self.simulated_n - rest_n).abs() < BALANCED_N;
        if !balanced || self.other_n.min(self.stepping_n) < STANDS_N {
            return None;
        }
        let n = |value: f64| fixed(value, 1);
        Some(format!(
            "In the pushes F6 is {} N in the model and {} N in the simulation (means), because the model lets the stepping \
             foot carry the whole front of the robot, {} N, while here the other foot stands beside it: {} N on the stepping foot, \
             {} N on the other, {} N together. At rest F6 is the foot's load less the weight that b6 carries, \
             m6 g = {} N: {} − {} = {} N. With the other foot's load on it, too, it would be {} N.",
            n(self.model_n),
            n(self.simulated_n),
            n(self.model_load_n),
            n(self.stepping_n),
            n(self.other_n),
            n(self.stepping_n + self.other_n),
            n(self.weight_n),
            n(self.stepping_n),
            n(self.weight_n),
            n(rest_n),
            n(rest_n + self.other_n),
        ))
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Fig. 16 with its explanation; `b6` is the index of the vertical cylinder that steps.
pub(super) fn figure(s: &Source<'_>, b6: usize) -> Figure {
    let series = vec![
        line(
            "simulated, unfiltered",
            colour::RAW,
            1,
            s.joint(b6, |j| j.force_net_raw_n),
        ),
        line(
            "reference model",
            colour::MODEL,
            2,
            s.model(0.0, |p| p.f6_n),
        ),
        line(
            "simulated robot, 20 Hz low-pass",
            colour::ROBOT,
            2,
            s.joint(b6, |j| j.force_net_n),
        ),
    ];
    let what = "Net generalised force on b6: pressure forces less seal friction less end-stop reaction. \
                Limit lines: the paper's axis, ±30 N. The unfiltered trace is cut off at the edges of the figure; its peaks are in the table.";
    let why = Push::of(s, b6).and_then(|push| push.explained());
    let caption: Vec<String> = [what.to_owned()].into_iter().chain(why).collect();
    let content = Content::lines(("[N]", (-60.0, 60.0)), series).limited(&[30.0, -30.0]);
    Figure {
        id: "fig16-f6".into(),
        title: "Fig. 16: force F6 on the vertical cylinder".into(),
        caption: caption.join(" "),
        panels: vec![s.panel("F6", 300, content)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{analyse, testing};
    use wheeleg_config::builtin;

    /// Two standing feet share the load; the sentence says so with their numbers, but only if they support
    /// it.
    #[test]
    fn the_other_foot_explains_the_gap_where_it_stands() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let told = |stepping_n: f64, other_n: f64, force_n: f64| {
            let mut recording = testing::from_reference(&robot, 0.0, 0.0);
            recording.feet[1] = recording.feet[0].clone();
            for (foot, load_n) in [stepping_n, other_n].into_iter().enumerate() {
                for row in &mut recording.feet[foot] {
                    row.v.normal_force_n = load_n;
                }
            }
            for row in &mut recording.joints[2] {
                row.v.force_net_n = force_n;
            }
            let analysis = analyse(&scenario, &robot, &recording);
            let source = Source {
                scenario: &scenario,
                robot: &robot,
                recording: &recording,
                analysis: &analysis,
            };
            let push = Push::of(&source, 2).expect("three pushes");
            assert!((20.0..27.0).contains(&push.model_n), "{push:?}");
            (push, push.explained())
        };
        let (push, text) = told(14.0, 17.5, 6.2);
        assert!((push.stepping_n, push.other_n) == (14.0, 17.5), "{push:?}");
        let text = text.expect("explained");
        for number in [
            "14.0 N",
            "17.5 N",
            "31.5 N together",
            "14.0 − 7.8 = 6.2 N",
            "23.7 N",
        ] {
            assert!(text.contains(number), "{number}: {text}");
        }
        // A foot in the air, and a force that is not that of the load, explain nothing.
        assert_eq!(told(14.0, 0.0, 6.2).1, None);
        assert_eq!(told(14.0, 17.5, 20.0).1, None);
    }
}
