//! The curves of the page.

use wheeleg_config::AxisConfig;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{Case, Move, Played, Variation};
use wheeleg_studies::study::Progress;

use super::{Options, plans};

/// Stroke and reference of a measured move, 1 ms apart, for the overlays.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlay {
    /// Axis.
    pub axis: String,
    /// Controller.
    pub kind: Kind,
    /// Move; the last of its measured ones.
    pub motion: Move,
    /// Time from the start of the motion \[s\], reference and stroke \[mm\].
    pub points: Vec<[f64; 3]>,
}

/// The curves of the first seed as on the sheet: its cases played again, because a row holds no curve. None of those
/// that left the plant's model, and none once the comparison is stopped.
pub(super) fn all(
    options: &Options,
    configs: &[AxisConfig],
    progress: &Progress,
) -> Result<Vec<Overlay>, StudyError> {
    let moves = plans::moves(options, &Move::LEARNT);
    let mut all: Vec<(&AxisConfig, Kind, Move)> = Vec::new();
    for config in configs {
        for kind in &options.kinds {
            all.extend(moves.iter().map(|motion| (config, *kind, *motion)));
        }
    }
    progress.begin("curves", all.len() as u64);
    let curve = |&(config, kind, motion): &(&AxisConfig, Kind, Move)| {
        let case = Case::new(&config.name, &config.axis, Variation::Nominal, options.seed);
        let played = case.and_then(|case| case.play(kind, motion));
        progress.step();
        let played = played.ok().flatten();
        Ok::<_, StudyError>(played.map(|played| Overlay::of(&config.name, kind, motion, &played)))
    };
    let drawn = progress.map(&all, curve)?;
    Ok(drawn.into_iter().flatten().flatten().collect())
}

impl Overlay {
    fn of(axis: &str, kind: Kind, motion: Move, played: &Played) -> Self {
        let trace = &played.measured[played.measured.len() - 1];
        let start_s = trace.motion.start_s();
        let points = trace.rows.iter().enumerate().map(|(k, r)| {
            [
                k as f64 * 1e-3 - start_s,
                r.reference_m * 1e3,
                r.stroke_m * 1e3,
            ]
        });
        Self {
            axis: axis.to_owned(),
            kind,
            motion,
            points: points.collect(),
        }
    }
}
