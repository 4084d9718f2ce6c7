//! Sliced valve PWM: compensation, slicing, switching counts.

use proptest::prelude::*;
use wheeleg_control::pwm::{OnTimes, PwmError, PwmTiming, ValvePwm};
use wheeleg_control::valve::{ValveMode, ValveOpenings, allocate};
use wheeleg_units::{Duty, Micros};

const PERIOD: u32 = 20_000;
const ON_DELAY: u32 = 5000;
const OFF_DELAY: u32 = 4000;
const MARGIN: u32 = 500;

fn timing() -> PwmTiming {
    let [period, tick, on, off, margin] = [PERIOD, 1000, ON_DELAY, OFF_DELAY, MARGIN].map(Micros);
    PwmTiming::new(period, tick, on, off, margin).expect("valid timing")
}

fn fill_a(opening_us: u32) -> ValveOpenings {
    ValveMode::FillA.openings(Micros(opening_us))
}

/// On-times of valve fill A over some ticks of a constant command.
fn run(pwm: &mut ValvePwm, opening_us: u32, ticks: usize) -> Vec<u16> {
    (0..ticks)
        .map(|_| pwm.tick(&fill_a(opening_us))[0])
        .collect()
}

/// A valve with its delays, in microseconds: how long it is open, and how often
/// its coil switches.
#[derive(Default)]
struct Valve {
    coil: bool,
    open: bool,
    since: u32,
    open_us: u32,
    switches: u32,
}

impl Valve {
    fn tick(&mut self, on_us: u16) {
        for now in 0..1000 {
            let coil = now < on_us;
            if coil != self.coil {
                self.coil = coil;
                self.since = 0;
                self.switches += 1;
            }
            let delay = if coil { ON_DELAY } else { OFF_DELAY };
            if self.open != coil && self.since >= delay {
                self.open = coil;
            }
            self.since += 1;
            self.open_us += u32::from(self.open);
        }
    }
}

#[test]
fn faulty_timings_are_refused_by_name() {
    let new = |v: [u32; 5]| {
        let [period, tick, on, off, margin] = v.map(Micros);
        PwmTiming::new(period, tick, on, off, margin).err()
    };
    assert_eq!(new([20_000, 1000, 5000, 4000, 500]), None);
    assert_eq!(new([20_000, 99, 5000, 4000, 500]), Some(PwmError::Tick));
    assert_eq!(new([20_000, 2001, 5000, 4000, 500]), Some(PwmError::Tick));
    assert_eq!(new([20_500, 1000, 5000, 4000, 500]), Some(PwmError::Period));
    assert_eq!(new([1000, 1000, 100, 100, 10]), Some(PwmError::Period));
    assert_eq!(new([1_001_000, 1000, 100, 100, 10]), Some(PwmError::Period));
    assert_eq!(new([20_000, 1000, 9500, 4000, 500]), None);
    assert_eq!(new([20_000, 1000, 9501, 4000, 500]), Some(PwmError::Delay));
    assert_eq!(new([20_000, 1000, 5000, 9501, 500]), Some(PwmError::Delay));
    assert_eq!(
        new([20_000, 1000, u32::MAX, 1, u32::MAX]),
        Some(PwmError::Delay)
    );
}

#[test]
fn the_coil_time_compensates_the_delays() {
    let pulse = |opening| timing().pulse(Micros(opening)).get();
    assert_eq!(pulse(0), 0);
    // 8 ms open: 8 + 5 − 4.
    assert_eq!(pulse(8000), 9000);
    // Shortest pulse t_on + margin = 5.5 ms, for 4.5 ms open; one less is not sent.
    assert_eq!(pulse(4500), 5500);
    assert_eq!(pulse(4499), 0);
    assert_eq!(pulse(1), 0);
    assert_eq!(timing().shortest_opening(), Micros(4500));
    let instant = [PERIOD, 1000, 0, 0, 0].map(Micros);
    let [period, tick, on, off, margin] = instant;
    let ideal = PwmTiming::new(period, tick, on, off, margin).expect("valid timing");
    assert_eq!(ideal.shortest_opening(), Micros(1));
    assert_eq!(ideal.pulse(Micros(1)), Micros(1));
    // Longest pulse with a gap of t_off + margin = 4.5 ms; one more is full.
    assert_eq!(pulse(14_500), 15_500);
    assert_eq!(pulse(14_501), PERIOD);
    assert_eq!(pulse(PERIOD - 1), PERIOD);
    assert_eq!(pulse(PERIOD), PERIOD);
    assert_eq!(pulse(u32::MAX), PERIOD);
}

#[test]
fn a_pulse_is_full_ticks_and_one_partial_tick() {
    let mut pwm = ValvePwm::new(timing());
    // 6350 µs open: 7350 µs of coil = 7 ticks and 350 µs.
    let on = run(&mut pwm, 6350, 40);
    let mut period = vec![1000; 7];
    period.push(350);
    period.resize(20, 0);
    assert_eq!(on, [period.clone(), period].concat());
    assert_eq!(pwm.pulses(), [2, 0, 0, 0]);
}

#[test]
fn an_idle_valve_acts_at_the_next_tick_whatever_the_phase() {
    for idle in 0..45 {
        let mut pwm = ValvePwm::new(timing());
        run(&mut pwm, 6000, 20);
        assert!(run(&mut pwm, 0, idle).iter().all(|&on| on == 0));
        assert_eq!(run(&mut pwm, 6000, 1), [1000], "after {idle} idle ticks");
    }
}

#[test]
fn a_whole_period_has_no_gap() {
    let mut pwm = ValvePwm::new(timing());
    assert!(run(&mut pwm, u32::MAX, 100).iter().all(|&on| on == 1000));
    assert_eq!(pwm.pulses(), [1, 0, 0, 0]);
}

#[test]
fn zero_ends_a_pulse_at_once_and_it_does_not_begin_again_in_its_period() {
    let mut pwm = ValvePwm::new(timing());
    assert_eq!(run(&mut pwm, 10_000, 2), [1000, 1000]);
    assert_eq!(pwm.shut(), [0; 4]);
    let again = run(&mut pwm, 10_000, 18);
    assert_eq!(&again[..17], [0; 17]);
    assert_eq!(again[17], 1000);
}

#[test]
fn a_pulse_follows_the_command_but_not_below_the_shortest() {
    // Shortened from 12 to 6 ms open (7 ms of coil) after 3 ticks.
    let mut pwm = ValvePwm::new(timing());
    run(&mut pwm, 12_000, 3);
    let rest: u32 = run(&mut pwm, 6000, 17)
        .iter()
        .map(|&on| u32::from(on))
        .sum();
    assert_eq!(3000 + rest, 7000);
    // Lengthened from 6 to 12 ms while it lasts.
    let mut pwm = ValvePwm::new(timing());
    run(&mut pwm, 6000, 3);
    let rest: u32 = run(&mut pwm, 12_000, 17)
        .iter()
        .map(|&on| u32::from(on))
        .sum();
    assert_eq!(3000 + rest, 13_000);
    // Lengthened after it ended: too late for this period.
    let mut pwm = ValvePwm::new(timing());
    run(&mut pwm, 6000, 8);
    assert!(run(&mut pwm, 12_000, 12).iter().all(|&on| on == 0));
}

#[test]
fn a_valve_is_open_for_as_long_as_it_was_asked() {
    for opening in [4500, 4999, 8000, 11_111, 14_500] {
        let mut pwm = ValvePwm::new(timing());
        let mut valve = Valve::default();
        for _ in 0..20 * 10 {
            valve.tick(pwm.tick(&fill_a(opening))[0]);
        }
        // Ten periods; the last closing may be cut off.
        let per_period = f64::from(valve.open_us) / 10.0;
        assert!(
            (per_period - f64::from(opening)).abs() <= 1.0,
            "{opening}: {per_period}"
        );
        assert_eq!(valve.switches, 20);
    }
}

#[test]
fn opposite_duties_use_opposite_pairs() {
    let on =
        |duty: Duty| -> OnTimes { ValvePwm::new(timing()).tick(&allocate(duty, Micros(PERIOD))) };
    assert_eq!(on(Duty::from_per_mille(500)), [1000, 0, 0, 1000]);
    assert_eq!(on(Duty::from_per_mille(-500)), [0, 1000, 1000, 0]);
    assert_eq!(on(Duty::ZERO), [0; 4]);
}

proptest! {
    #[test]
    fn any_commands_switch_a_valve_at_most_twice_a_period_and_let_it_act(
        commands in prop::collection::vec((0_u32..25_000, 1_usize..30), 1..40),
    ) {
        let mut pwm = ValvePwm::new(timing());
        let (mut on_us, mut starts) = (Vec::new(), Vec::new());
        let mut previous = 0;
        for (opening, ticks) in commands {
            for _ in 0..ticks {
                let [on, others @ ..] = pwm.tick(&fill_a(opening));
                prop_assert_eq!(others, [0; 3]);
                prop_assert!(on <= 1000);
                if on > 0 && previous < 1000 {
                    starts.push(on_us.len());
                }
                previous = on;
                on_us.push(on);
            }
        }
        for pair in starts.windows(2) {
            prop_assert!(pair[1] - pair[0] >= 20, "restarted within a period: {:?}", pair);
            // The gap before a new pulse lets the valve shut.
            let pulse: u32 = on_us[pair[0]..pair[1]].iter().map(|&on| u32::from(on)).sum();
            let gap = 1000 * (pair[1] - pair[0]) - pulse as usize;
            prop_assert!(gap >= (OFF_DELAY + MARGIN) as usize, "gap {}", gap);
        }
        prop_assert_eq!(pwm.pulses()[0] as usize, starts.len());
    }

    #[test]
    fn a_constant_command_is_sliced_without_loss(opening in 0_u32..25_000) {
        let expected = timing().pulse(Micros(opening)).get();
        let mut pwm = ValvePwm::new(timing());
        for _ in 0..3 {
            let sum: u32 = run(&mut pwm, opening, 20).iter().map(|&on| u32::from(on)).sum();
            prop_assert_eq!(sum, expected);
        }
    }
}
