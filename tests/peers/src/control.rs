//! The fuzzy engine and the wheel controller of the boards, on the host.

use std::hint::black_box;

use wheeleg_control::paper::fuzzy::{GridRules, Partition};
use wheeleg_control::wheel::{LeadFilter, WheelCommand, WheelController, WheelInput, WheelMode};
use wheeleg_peers::random::SplitMix;
use wheeleg_units::WheelCount;

use crate::measure::{put_ns, repetitions, timed};

const INPUTS: usize = 4096;

/// Seven even sets an input and the rules clamp(i + j − 6, −3, 3)/3, as in the reference. The engine
/// takes the minimum for AND, as the chip does, where the reference takes the product.
const RULES: GridRules<7, 7> = {
    let Ok(sets) = Partition::<7>::even(-32768, 32767) else {
        panic!("even partition");
    };
    let mut table = [[0_i16; 7]; 7];
    let mut i = 0;
    while i < 7 {
        let mut j = 0;
        while j < 7 {
            let k = i as i32 + j as i32 - 6;
            let k = if k > 3 {
                3
            } else if k < -3 {
                -3
            } else {
                k
            };
            table[i][j] = (k * 32767 / 3) as i16;
            j += 1;
        }
        i += 1;
    }
    let Ok(rules) = GridRules::new(sets, sets, table) else {
        panic!("rule table");
    };
    rules
};

#[inline(never)]
fn infer(e: i16, d: i16) -> i16 {
    RULES.infer(e, d)
}

/// The same rules with minimum and weighted mean in floating point.
fn exact(e: i16, d: i16) -> f64 {
    let sets = |x: i16| {
        let place = (f64::from(x) / 32768.0 + 1.0) * 3.0;
        let low = (place.floor() as usize).min(5);
        (low, place - low as f64)
    };
    let ((i, a), (j, b)) = (sets(e), sets(d));
    let (mut sum, mut weight) = (0.0, 0.0);
    for (di, wa) in [(0, 1.0 - a), (1, a)] {
        for (dj, wb) in [(0, 1.0 - b), (1, b)] {
            let k = ((i + di + j + dj) as f64 - 6.0).clamp(-3.0, 3.0);
            let w = wa.min(wb);
            sum += w * k / 3.0;
            weight += w;
        }
    }
    sum / weight
}

pub(crate) fn fuzzy() {
    let mut random = SplitMix(11);
    let mut draw = || (random.bits() >> 48) as u16 as i16;
    let inputs: Vec<(i16, i16)> = (0..INPUTS).map(|_| (draw(), draw())).collect();
    let sum: f64 = inputs
        .iter()
        .map(|&(e, d)| f64::from(infer(e, d)) / 32767.0)
        .sum();
    let float: f64 = inputs.iter().map(|&(e, d)| exact(e, d)).sum();
    let repetitions = repetitions(5000.0);
    let mut outputs = [0_i16; INPUTS];
    let took = timed(|| {
        for _ in 0..repetitions {
            for (y, &(e, d)) in outputs.iter_mut().zip(&inputs) {
                *y = black_box(infer(e, d));
            }
        }
    });
    let check = format!("sum={sum:.3} (AND = min; in f64 {float:.3})");
    put_ns(
        "fuzzy",
        "_grid_min_call",
        took,
        repetitions * INPUTS,
        &check,
    );
}

#[inline(never)]
fn sample(wheel: &mut WheelController, input: &WheelInput) -> i8 {
    wheel.step(input).motor_command
}

/// One sample of the whole wheel controller in position mode: difference of 24-bit positions, lead
/// filter, limits, flags and the PWM port. The reference does the filter's line alone.
pub(crate) fn filter() {
    let mut random = SplitMix(5);
    let inputs: Vec<WheelInput> = (0..INPUTS)
        .map(|_| {
            let error = ((random.bits() >> 32) as u32 as i32) >> 19;
            WheelInput {
                actual: WheelCount::wrapping_new(error.wrapping_neg()),
                ..WheelInput::default()
            }
        })
        .collect();
    let mut wheel = WheelController::new();
    let filter = LeadFilter {
        zero: 230,
        pole: 128,
        gain: 2,
    };
    for command in [
        WheelCommand::Filter(filter),
        WheelCommand::Enter(WheelMode::Position),
    ] {
        if wheel.apply(command).is_err() {
            return;
        }
    }
    let sum: i64 = inputs
        .iter()
        .map(|x| i64::from(sample(&mut wheel, x)))
        .sum();
    let repetitions = repetitions(5000.0);
    let took = timed(|| {
        for _ in 0..repetitions {
            for input in &inputs {
                black_box(sample(&mut wheel, input));
            }
        }
    });
    let check = format!("sum={sum} (8-bit port)");
    put_ns(
        "filter_1",
        "_wheel_step",
        took,
        repetitions * INPUTS,
        &check,
    );
}
