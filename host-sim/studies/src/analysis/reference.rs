//! The reference model of the paper's figures: the responses of critically damped cylinders to square-wave
//! references (MODEL.md §6.2).

use wheeleg_config::{GaitParams, ReferenceParams};

/// Position, speed and acceleration of one cylinder, SI.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Motion {
    x: f64,
    v: f64,
    a: f64,
}

/// Critically damped response from `from` to the target `xt`, `t` s after the switch.
fn critically_damped(from: Motion, xt: f64, tau: f64, t: f64) -> Motion {
    let a0 = from.x - xt;
    let b = from.v + a0 / tau;
    let decay = (-t / tau).exp();
    let p = a0 + b * t;
    Motion {
        x: xt + p * decay,
        v: (b - p / tau) * decay,
        a: (-2.0 * b / tau + p / (tau * tau)) * decay,
    }
}

/// Distance, speed and acceleration of a trapezoidal move over `distance`.
fn trapezoid(distance: f64, speed: f64, acceleration: f64, t: f64) -> Motion {
    if distance <= 0.0 || t <= 0.0 {
        return Motion::default();
    }
    // A short move never reaches the speed: a triangle.
    let speed = speed.min((distance * acceleration).sqrt());
    let ramp = speed / acceleration;
    let cruise = distance / speed - ramp;
    let end = 2.0 * ramp + cruise;
    if t < ramp {
        Motion {
            x: 0.5 * acceleration * t * t,
            v: acceleration * t,
            a: acceleration,
        }
    } else if t < ramp + cruise {
        Motion {
            x: 0.5 * speed * ramp + speed * (t - ramp),
            v: speed,
            a: 0.0,
        }
    } else if t < end {
        let left = end - t;
        Motion {
            x: distance - 0.5 * acceleration * left * left,
            v: acceleration * left,
            a: -acceleration,
        }
    } else {
        Motion {
            x: distance,
            ..Motion::default()
        }
    }
}

/// One instant of the reference model. Strokes, not joint lengths.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReferencePoint {
    /// Time since the gait's start, s.
    pub t_s: f64,
    /// Stroke of the horizontal cylinder, m.
    pub s5_m: f64,
    /// Its speed, m/s.
    pub v5_m_s: f64,
    /// Its acceleration, m/s².
    pub a5_m_s2: f64,
    /// Stroke of the vertical cylinder, m.
    pub s6_m: f64,
    /// Its speed, m/s.
    pub v6_m_s: f64,
    /// Its acceleration, m/s².
    pub a6_m_s2: f64,
    /// Ground load on the foot, N.
    pub load_n: f64,
    /// Force on b6: m6 (a6 − g) + d6 v6 + load, N.
    pub f6_n: f64,
    /// Travel of the chassis, m.
    pub travel_m: f64,
}

/// State at the start of a step.
#[derive(Debug, Clone, Copy)]
struct StepStart {
    b5: Motion,
    b6: Motion,
    travel_m: f64,
}

/// The reference model, evaluated in closed form from step to step.
#[derive(Debug, Clone)]
pub struct ReferenceModel {
    reference: ReferenceParams,
    gait: GaitParams,
    steps: Vec<StepStart>,
}

impl ReferenceModel {
    /// Prepares the start states of all steps.
    #[must_use]
    pub fn new(reference: ReferenceParams, gait: GaitParams) -> Self {
        let mut model = Self {
            reference,
            gait,
            steps: Vec::new(),
        };
        let mut start = StepStart {
            b5: Motion::default(),
            b6: Motion {
                x: gait.stroke_m,
                ..Motion::default()
            },
            travel_m: 0.0,
        };
        for _ in 0..gait.steps {
            let (b5, b6, travel_m) = model.within_step(&start, gait.period_s);
            model.steps.push(start);
            start = StepStart { b5, b6, travel_m };
        }
        model
    }

    /// The model at `t_s` since the gait's start; before it the robot stands
    /// at home, after the last step it stays where that step ended.
    #[must_use]
    pub fn at(&self, t_s: f64) -> ReferencePoint {
        let total = self.gait.period_s * f64::from(self.gait.steps);
        let t = t_s.clamp(0.0, total);
        let last = self.steps.len().saturating_sub(1);
        let k = ((t / self.gait.period_s) as usize).min(last);
        let Some(start) = self.steps.get(k) else {
            return ReferencePoint::default();
        };
        let u = t - k as f64 * self.gait.period_s;
        let (b5, b6, travel_m) = self.within_step(start, u);
        let load_n = self.load(u, b5.x);
        let r = &self.reference;
        ReferencePoint {
            t_s,
            s5_m: b5.x,
            v5_m_s: b5.v,
            a5_m_s2: b5.a,
            s6_m: b6.x,
            v6_m_s: b6.v,
            a6_m_s2: b6.a,
            load_n,
            f6_n: r.m6_kg * (b6.a - r.gravity_m_s2) + r.d6_n_s_m * b6.v + load_n,
            travel_m,
        }
    }

    fn within_step(&self, start: &StepStart, u: f64) -> (Motion, Motion, f64) {
        let g = &self.gait;
        let r = &self.reference;
        // The command comes at `lift`; the model leaves the ground once the foot is unloaded.
        let lift_s = g.lift_s + r.unload_s;
        let retract = |u: f64| critically_damped(start.b6, 0.0, r.tau_fast_s, u - lift_s);
        let b6 = if u < lift_s {
            Motion {
                x: start.b6.x,
                ..Motion::default()
            }
        } else if u < g.lower_s {
            retract(u)
        } else {
            let top = retract(g.lower_s);
            critically_damped(top, g.stroke_m, r.tau_extend_s, u - g.lower_s)
        };
        let reach = |u: f64| critically_damped(start.b5, g.stroke_m, r.tau_fast_s, u - g.reach_s);
        if u < g.reach_s {
            let b5 = Motion {
                x: start.b5.x,
                ..Motion::default()
            };
            return (b5, b6, start.travel_m);
        }
        if u < g.push_s {
            return (reach(u), b6, start.travel_m);
        }
        // The chassis travels the stroke that b5 has reached; b5 gives way.
        let reached = reach(g.push_s).x;
        let push = trapezoid(
            reached,
            g.push_speed_m_s,
            g.push_acceleration_m_s2,
            u - g.push_s,
        );
        let b5 = Motion {
            x: reached - push.x,
            v: -push.v,
            a: -push.a,
        };
        (b5, b6, start.travel_m + push.x)
    }

    /// Ground load on the foot: the static share by moments about the axle,
    /// with linear ramps where the foot leaves and meets the ground.
    fn load(&self, u: f64, s5_m: f64) -> f64 {
        let r = &self.reference;
        let share =
            r.gravity_m_s2 * (r.load_moment_kg_m + r.slide_mass_kg * s5_m) / (r.load_arm_m + s5_m);
        let unloading = u - self.gait.lift_s;
        let fraction = if unloading < r.unload_s {
            1.0 - unloading.max(0.0) / r.unload_s
        } else if u < r.reload_start_s {
            0.0
        } else if u < r.reload_end_s {
            (u - r.reload_start_s) / (r.reload_end_s - r.reload_start_s)
        } else {
            1.0
        };
        share * fraction
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    fn model() -> ReferenceModel {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        ReferenceModel::new(robot.reference, robot.gait)
    }

    fn range(value: impl Fn(&ReferencePoint) -> f64) -> (f64, f64) {
        let model = model();
        (0..100_000)
            .map(|i| value(&model.at(f64::from(i) * 1e-4)))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
                (lo.min(v), hi.max(v))
            })
    }

    fn assert_range(name: &str, (lo, hi): (f64, f64), min: f64, max: f64, tolerance: f64) {
        assert!(
            (lo - min).abs() < tolerance,
            "{name} min {lo}, expected {min}"
        );
        assert!(
            (hi - max).abs() < tolerance,
            "{name} max {hi}, expected {max}"
        );
    }

    /// Ranges of MODEL.md §6.2, last printed digit.
    #[test]
    fn ranges_are_those_of_the_independent_computation() {
        assert_range("v5", range(|p| p.v5_m_s * 1e3), -180.0, 378.4, 0.06);
        assert_range("v6", range(|p| p.v6_m_s * 1e3), -378.4, 319.4, 0.06);
        assert_range("a5", range(|p| p.a5_m_s2), -0.80, 5.88, 0.006);
        assert_range("a6", range(|p| p.a6_m_s2), -5.88, 4.65, 0.006);
        assert_range("F6", range(|p| p.f6_n), -13.97, 25.78, 0.006);
        let (lo, hi) = range(|p| p.s6_m * 1e3);
        assert!(lo > 0.0 && lo < 10.0 && hi <= 180.0 && hi > 179.99);
    }

    #[test]
    fn f6_starts_at_its_positive_maximum_and_changes_sign_in_the_first_second() {
        let model = model();
        let first = model.at(0.0).f6_n;
        assert!((first - 25.776).abs() < 0.01, "{first}");
        assert!(model.at(0.15).f6_n < 0.0);
    }

    #[test]
    fn speed_and_acceleration_are_the_derivatives_of_the_stroke() {
        let model = model();
        let h = 1e-6;
        for t in [0.3, 0.7, 1.2, 1.9, 2.2, 2.8, 3.2, 4.1, 8.0] {
            let (before, here, after) = (model.at(t - h), model.at(t), model.at(t + h));
            let v5 = (after.s5_m - before.s5_m) / (2.0 * h);
            let v6 = (after.s6_m - before.s6_m) / (2.0 * h);
            let a5 = (after.v5_m_s - before.v5_m_s) / (2.0 * h);
            let a6 = (after.v6_m_s - before.v6_m_s) / (2.0 * h);
            assert!((v5 - here.v5_m_s).abs() < 1e-6, "v5 at {t}");
            assert!((v6 - here.v6_m_s).abs() < 1e-6, "v6 at {t}");
            assert!((a5 - here.a5_m_s2).abs() < 1e-5, "a5 at {t}");
            assert!((a6 - here.a6_m_s2).abs() < 1e-5, "a6 at {t}");
        }
    }

    #[test]
    fn foot_stands_still_while_the_chassis_passes_over_it() {
        let model = model();
        let a = model.at(2.1);
        let b = model.at(3.2);
        assert!(((a.s5_m + a.travel_m) - (b.s5_m + b.travel_m)).abs() < 1e-12);
        // Three strokes of travel, less the little that is missing in each step.
        let travel = model.at(10.0).travel_m;
        assert!((0.535..0.54).contains(&travel), "{travel}");
    }
}
