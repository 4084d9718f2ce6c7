//! Inputs of a bench axis: references and loads over time.

/// A reference over time; positions in m, times in s from the start of the run.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// A jump at `at_s`.
    Step {
        /// Time of the jump \[s\].
        at_s: f64,
        /// Reference before \[m\].
        from_m: f64,
        /// Reference after \[m\].
        to_m: f64,
    },
    /// A smooth move of least jerk: 10 s³ − 15 s⁴ + 6 s⁵ over `duration_s`.
    SCurve {
        /// Start \[s\].
        at_s: f64,
        /// Duration \[s\].
        duration_s: f64,
        /// Reference before \[m\].
        from_m: f64,
        /// Reference after \[m\].
        to_m: f64,
    },
    /// Whole periods of a sinusoid from its lowest point; it ends where it began.
    Sine {
        /// Start \[s\].
        at_s: f64,
        /// Period \[s\].
        period_s: f64,
        /// Number of periods.
        periods: u32,
        /// Reference before and after \[m\].
        from_m: f64,
        /// Reference at the crest \[m\].
        crest_m: f64,
    },
}

impl Motion {
    /// No motion: a constant reference.
    #[must_use]
    pub const fn hold(at_m: f64) -> Self {
        Self::Step {
            at_s: 0.0,
            from_m: at_m,
            to_m: at_m,
        }
    }

    /// Start of the motion \[s\].
    #[must_use]
    pub const fn start_s(&self) -> f64 {
        match *self {
            Self::Step { at_s, .. } | Self::SCurve { at_s, .. } | Self::Sine { at_s, .. } => at_s,
        }
    }

    /// Reference before the motion \[m\].
    #[must_use]
    pub const fn from_m(&self) -> f64 {
        match *self {
            Self::Step { from_m, .. } | Self::SCurve { from_m, .. } | Self::Sine { from_m, .. } => {
                from_m
            }
        }
    }

    /// Reference at the end \[m\].
    #[must_use]
    pub const fn to_m(&self) -> f64 {
        match *self {
            Self::Step { to_m, .. } | Self::SCurve { to_m, .. } => to_m,
            Self::Sine { from_m, .. } => from_m,
        }
    }

    /// Reference and its speed at a time \[m, m/s\].
    #[must_use]
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        match *self {
            Self::Step { at_s, from_m, to_m } => (if t_s < at_s { from_m } else { to_m }, 0.0),
            Self::SCurve {
                at_s,
                duration_s,
                from_m,
                to_m,
            } => {
                let s = ((t_s - at_s) / duration_s).clamp(0.0, 1.0);
                let d = to_m - from_m;
                let shape = s * s * s * (10.0 + s * (6.0 * s - 15.0));
                let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / duration_s;
                (from_m + d * shape, d * rate)
            }
            Self::Sine {
                at_s,
                period_s,
                periods,
                from_m,
                crest_m,
            } => {
                let t = t_s - at_s;
                if t <= 0.0 || t >= period_s * f64::from(periods) {
                    return (from_m, 0.0);
                }
                let (half, w) = (0.5 * (crest_m - from_m), std::f64::consts::TAU / period_s);
                (
                    from_m + half * (1.0 - (w * t).cos()),
                    half * w * (w * t).sin(),
                )
            }
        }
    }
}

/// The force on the rod from `at_s` on \[N\], positive extends; piecewise constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadEvent {
    /// Time \[s\].
    pub at_s: f64,
    /// Force \[N\].
    pub load_n: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sinusoid_reaches_its_crest_and_ends_where_it_began() {
        let m = Motion::Sine {
            at_s: 0.1,
            period_s: 2.0,
            periods: 2,
            from_m: 0.05,
            crest_m: 0.11,
        };
        let near = |t: f64, x: f64, v: f64| {
            let (at, rate) = m.at(t);
            assert!(
                (at - x).abs() < 1e-12 && (rate - v).abs() < 1e-12,
                "{t}: {at} {rate}"
            );
        };
        near(0.0, 0.05, 0.0);
        near(0.6, 0.08, 0.03 * std::f64::consts::PI);
        near(1.1, 0.11, 0.0);
        near(3.6, 0.08, -0.03 * std::f64::consts::PI);
        near(4.2, 0.05, 0.0);
        assert_eq!((m.from_m(), m.to_m(), m.start_s()), (0.05, 0.05, 0.1));
    }

    #[test]
    fn the_s_curve_ends_at_rest_and_its_rate_is_its_slope() {
        let m = Motion::SCurve {
            at_s: 0.2,
            duration_s: 1.0,
            from_m: 0.05,
            to_m: 0.114,
        };
        assert_eq!(m.at(0.1), (0.05, 0.0));
        let (end, rate) = m.at(1.3);
        assert!((end - 0.114).abs() < 1e-15 && rate == 0.0);
        for i in 1..40 {
            let t = 0.2 + 0.025 * f64::from(i);
            let slope = (m.at(t + 1e-6).0 - m.at(t - 1e-6).0) / 2e-6;
            assert!((slope - m.at(t).1).abs() < 1e-7);
        }
        // Peak speed 1.875 times the mean.
        assert!((m.at(0.7).1 - 1.875 * 0.064).abs() < 1e-12);
    }
}
