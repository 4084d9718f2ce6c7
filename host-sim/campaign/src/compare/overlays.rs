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

/// A curve of the page: of the first seed, as on the sheet.
pub(super) struct Wanted<'a> {
    config: &'a AxisConfig,
    kind: Kind,
    motion: Move,
}

/// The curves of a comparison.
pub(super) fn wanted<'a>(options: &Options, configs: &'a [AxisConfig]) -> Vec<Wanted<'a>> {
    let moves = plans::moves(options, &Move::LEARNT);
    let mut all = Vec::new();
    for config in configs {
        for kind in &options.kinds {
            all.extend(moves.iter().map(|motion| Wanted {
                config,
                kind: *kind,
                motion: *motion,
            }));
        }
    }
    all
}

/// The curves, from their cases played again, because a row holds none; `None` of a case that cannot be played. Fewer
/// once the comparison is stopped.
pub(super) fn all(
    options: &Options,
    wanted: &[Wanted<'_>],
    progress: &Progress,
) -> Result<Vec<Option<Overlay>>, StudyError> {
    progress.begin("curves", wanted.len() as u64);
    let curve = |wanted: &Wanted<'_>| {
        let (config, kind, motion) = (wanted.config, wanted.kind, wanted.motion);
        let case = Case::new(&config.name, &config.axis, Variation::Nominal, options.seed);
        let played = case.and_then(|case| case.play(kind, motion));
        progress.step();
        let played = played.ok().flatten();
        Ok::<_, StudyError>(played.map(|played| Overlay::of(&config.name, kind, motion, &played)))
    };
    Ok(progress.map(wanted, curve)?.into_iter().flatten().collect())
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
