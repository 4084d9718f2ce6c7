//! Targets of the paper's section 6 (Figs. 5–8): A8, A9, A11 and tracking.

use super::{Extremes, Target};
use wheeleg_config::RobotConfig;
use wheeleg_telemetry::JointSample;

/// Motion of a joint.
#[derive(Debug, Default)]
struct Track {
    stroke_mm: Extremes,
    speed_mm_s: Extremes,
    samples: u64,
    /// Sum of the squares of the tracking error, mm².
    squares: f64,
    peak_mm: f64,
}

impl Track {
    fn joint(&mut self, v: &JointSample) {
        self.stroke_mm.add(v.position_mm);
        self.speed_mm_s.add(v.velocity_mm_s.abs());
        let error = v.reference_mm - v.position_mm;
        self.samples += 1;
        self.squares += error * error;
        self.peak_mm = self.peak_mm.max(error.abs());
    }
}

/// The moving leg, while its samples come in.
#[derive(Debug, Default)]
pub(super) struct SinusoidMeter {
    b5: Track,
    b6: Track,
}

impl SinusoidMeter {
    pub(super) fn b5(&mut self, v: &JointSample) {
        self.b5.joint(v);
    }

    pub(super) fn b6(&mut self, v: &JointSample) {
        self.b6.joint(v);
    }

    pub(super) fn targets(self, robot: &RobotConfig) -> Vec<Target> {
        targets(robot, &self.b5, &self.b6)
    }
}

fn targets(robot: &RobotConfig, b5_track: &Track, b6_track: &Track) -> Vec<Target> {
    let (b5, b6) = (b5_track.stroke_mm.0, b6_track.stroke_mm.0);
    // The paper's axes are joint lengths.
    let zero_mm = robot.plant.stroke_zero_m.map(|m| m * 1e3);
    let mut targets = vec![
        Target::new(
            "A8",
            "b5 smallest (axis −100 … 300)",
            b5.map(|r| r.0 + zero_mm[1]),
            "mm",
            Some(-100.0),
            Some(300.0),
        ),
        Target::new(
            "A8-span",
            "b5 span (more than 100 for this axis)",
            b5.map(|r| r.1 - r.0),
            "mm",
            Some(100.0),
            Some(300.0),
        ),
        Target::new(
            "A9",
            "b6 smallest (axis 0 … 200)",
            b6.map(|r| r.0 + zero_mm[2]),
            "mm",
            Some(0.0),
            Some(200.0),
        ),
        Target::new(
            "A9-span",
            "b6 span (more than 150 for this axis)",
            b6.map(|r| r.1 - r.0),
            "mm",
            Some(150.0),
            Some(200.0),
        ),
    ];
    // With the speed axis of the paper's plot, mm/s.
    for (name, track, axis) in [("b5", b5_track, 10.0), ("b6", b6_track, 40.0)] {
        let rms = (track.squares / track.samples.max(1) as f64).sqrt();
        let peak = track.peak_mm;
        let measured = track.samples > 0;
        targets.push(
            Target::new(
                format!("T-{name}-rms"),
                format!("{name} tracking error, root mean square"),
                measured.then_some(rms),
                "mm",
                None,
                Some(5.0),
            )
            .info(),
        );
        targets.push(
            Target::new(
                format!("T-{name}-peak"),
                format!("{name} tracking error, largest"),
                measured.then_some(peak),
                "mm",
                None,
                None,
            )
            .info(),
        );
        let speed = track.speed_mm_s.0.map(|r| r.1);
        targets.push(
            Target::new(
                format!("A11-{name}"),
                format!("largest speed of {name} (axis ±{axis}; the paper plots the ideal motion)"),
                speed,
                "mm/s",
                None,
                Some(axis),
            )
            .info(),
        );
    }
    targets
}
