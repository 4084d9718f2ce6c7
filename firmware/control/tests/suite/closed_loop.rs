//! The joint law, the valve PWM and a simple plant in a loop: it moves the right
//! way, comes to rest, and stops switching.

use wheeleg_control::joint::{Correction, JointConfig, JointController, JointGains, JointInput};
use wheeleg_control::pwm::{PwmTiming, ValvePwm};
use wheeleg_units::{Duty, Micros, PositionMm};

const TICK: Micros = Micros(1000);

fn controller(gains: &JointGains) -> JointController {
    JointController::new(JointConfig::new(gains, TICK).expect("valid gains"))
}

fn at(measured_mm: f64, reference_mm: f64) -> JointInput {
    JointInput {
        measured: PositionMm::from_f64(measured_mm),
        reference: PositionMm::from_f64(reference_mm),
        ..JointInput::default()
    }
}

/// A valve-driven piston in its simplest form: its velocity follows the open
/// valves with a lag; valves have delays.
struct Plant {
    position_mm: f64,
    velocity_mm_s: f64,
    /// Coil and valve state per valve, with the time left until it switches.
    coil: [bool; 4],
    open: [bool; 4],
    pending_us: [f64; 4],
    switches: usize,
}

impl Plant {
    const SUBSTEP_US: f64 = 50.0;

    fn new(position_mm: f64) -> Self {
        Self {
            position_mm,
            velocity_mm_s: 0.0,
            coil: [false; 4],
            open: [false; 4],
            pending_us: [0.0; 4],
            switches: 0,
        }
    }

    fn tick(&mut self, on_us: [u16; 4]) {
        let mut now_us = 0.0;
        while now_us < 1000.0 {
            for (valve, &on) in on_us.iter().enumerate() {
                let coil = now_us < f64::from(on);
                if coil != self.coil[valve] {
                    self.coil[valve] = coil;
                    self.pending_us[valve] = if coil { 5000.0 } else { 4000.0 };
                    self.switches += 1;
                }
                if self.open[valve] != self.coil[valve] {
                    self.pending_us[valve] -= Self::SUBSTEP_US;
                    if self.pending_us[valve] <= 0.0 {
                        self.open[valve] = self.coil[valve];
                    }
                }
            }
            let open = self.open.map(|open| if open { 1.0 } else { 0.0 });
            let [fill_a, vent_a, fill_b, vent_b] = open;
            // 250 mm/s with a pair open, reached with a lag of 30 ms.
            let target = 125.0 * (fill_a + vent_b - fill_b - vent_a);
            let dt = Self::SUBSTEP_US * 1e-6;
            self.velocity_mm_s += (target - self.velocity_mm_s) * dt / 0.030;
            self.position_mm = (self.position_mm + self.velocity_mm_s * dt).clamp(0.0, 180.0);
            now_us += Self::SUBSTEP_US;
        }
    }
}

#[test]
fn closed_loop_moves_towards_the_target_settles_and_stops_switching() {
    for (correction, start, target) in [
        (Correction::Pd, 20.0, 120.0),
        (Correction::Pd, 150.0, 40.0),
        (Correction::Id, 60.0, 80.0),
        (Correction::Id, 90.0, 85.0),
    ] {
        // These valves shut slower than those of the defaults.
        let gains = JointGains {
            dead_zone_duty: Duty::from_per_mille(230),
            ..JointGains::default()
        };
        let mut joint = controller(&gains);
        joint.set_correction(correction);
        let delay = |us| Micros(us);
        let timing = PwmTiming::new(gains.pwm_period, TICK, delay(5000), delay(4000), delay(500));
        let mut pwm = ValvePwm::new(timing.expect("valid timing"));
        let mut plant = Plant::new(start);
        let mut last_switch = 0;
        let direction = if target > start { 1.0 } else { -1.0 };
        let (mut overshoot, mut on) = (0.0_f64, [0; 4]);
        for tick in 0..4000 {
            let before = plant.switches;
            // Outputs take effect at the next tick edge.
            plant.tick(on);
            if plant.switches != before {
                last_switch = tick;
            }
            let quantised = (plant.position_mm * 4096.0 / 180.0).round() * 180.0 / 4096.0;
            let output = joint.step(&at(quantised, target));
            on = pwm.tick(&output.openings);
            // Commanded, sensed and physical agree about the direction.
            if tick == 60 {
                assert!(
                    (plant.position_mm - start) * direction > 0.5,
                    "{start}: {}",
                    plant.position_mm
                );
                assert!(output.velocity.to_f64() * direction > 0.0);
                assert!((output.velocity.to_f64() - plant.velocity_mm_s).abs() < 80.0);
            }
            overshoot = overshoot.max((plant.position_mm - target) * direction);
        }
        let error = plant.position_mm - target;
        println!(
            "{correction:?} {start} to {target}: error {error:.2}, overshoot {overshoot:.2}, last switch {last_switch} ms"
        );
        assert!(joint.is_settled());
        assert!(
            error.abs() <= 0.85,
            "{correction:?} {start} to {target}: {error}"
        );
        assert!(
            overshoot < 3.0,
            "{correction:?} {start} to {target}: {overshoot}"
        );
        assert!((50..2500).contains(&last_switch), "{last_switch}");
    }
}
