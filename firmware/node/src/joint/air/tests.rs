//! Tests of the air estimate.

use super::*;
use crate::JOINT_TICK;
use crate::checksum::Checksum;
use wheeleg_control::axis::AxisData;

const MIDDLE: PositionMm = PositionMm::from_int(90);

fn of(data: &AxisData) -> AirModel {
    AirModel::new(&AxisModel::new(data, JOINT_TICK).unwrap(), data.valve_on)
}

fn model() -> AirModel {
    of(&AxisData::default())
}

/// Absolute pressures in bar after this many ticks with these on-times.
fn after(ticks: u32, on: OnTimes, start: [f64; 2], model: &AirModel) -> [f64; 2] {
    let raw = |bar: f64| (bar / 7.01325 * f64::from(SUPPLY)) as i32;
    let mut air = Air::unknown(model, MIDDLE);
    [air.a.p, air.b.p] = start.map(raw);
    // One more round, in which each chamber processes what it has not yet seen.
    for _ in 0..ticks {
        air.follow(&on, MIDDLE, model, false);
    }
    for _ in 0..ROUND {
        air.follow(&[0; 4], MIDDLE, model, false);
    }
    [air.a.p, air.b.p].map(|p| f64::from(p) / f64::from(SUPPLY) * 7.01325)
}

#[test]
fn choked_flow_fills_at_a_constant_rate_and_empties_by_an_exponential() {
    let model = model();
    // C ρ0 R T: 0.085 dm³/(s bar) × 0.9972 bar; A: π/4 × 20² × 90 mm³ + 15.1 cm³.
    let volume_a = core::f64::consts::PI * 100.0 * 90.0 / 1e6 + 0.0151;
    let rate = 1.2 * 0.085 * 0.9972 * 7.01325 / volume_a;
    let [a, _] = after(100, [1000, 0, 0, 0], [1.2, 1.2], &model);
    assert!((a - 1.2 - rate * 0.1).abs() < 0.03, "{a} {rate}");
    let volume_b = core::f64::consts::PI * (100.0 - 16.0) * 90.0 / 1e6 + 0.0151;
    let [_, b] = after(100, [0, 0, 0, 1000], [7.0, 7.0], &model);
    let left = 7.0 * (-1.2 * 0.085 * 0.9972 / volume_b * 0.1_f64).exp();
    assert!((b - left).abs() < 0.03, "{b} {left}");
    // Both end where they must.
    let [a, b] = after(3000, [1000, 0, 0, 1000], [1.0, 7.0], &model);
    assert!(
        (a - 7.013).abs() < 0.01 && (b - 1.013).abs() < 0.01,
        "{a} {b}"
    );
    // Half the opening time gives half the air.
    let [half, _] = after(200, [500, 0, 0, 0], [1.2, 1.2], &model);
    let [full, _] = after(100, [1000, 0, 0, 0], [1.2, 1.2], &model);
    assert!((half - full).abs() < 0.01, "{half} {full}");
}

#[test]
fn a_piston_that_moves_squeezes_by_the_polytropic_law() {
    let model = model();
    let mut air = Air::unknown(&model, MIDDLE);
    let (a, b) = (f64::from(air.a.p), f64::from(air.b.p));
    for step in 0..=600 {
        let at = PositionMm::from_raw((90 << 16) + step * 6554);
        air.follow(&[0; 4], at, &model, false);
    }
    let length = |lead: f64, stroke: f64| lead + stroke;
    let [lead_a, lead_b] = [model.a.lead, model.b.lead].map(|lead| f64::from(lead) / 256.0);
    let law = |from: f64, to: f64| (from / to).powf(1.2);
    let falls = law(length(lead_a, 90.0), length(lead_a, 150.0));
    let rises = law(length(lead_b, 90.0), length(lead_b, 30.0));
    assert!((f64::from(air.a.p) / a / falls - 1.0).abs() < 0.02);
    assert!((f64::from(air.b.p) / b / rises - 1.0).abs() < 0.02);
    // A new calibration moves no air, and nor does noise.
    let before = air;
    air.follow(&[0; 4], MIDDLE, &model, false);
    air.follow(
        &[0; 4],
        PositionMm::from_raw((90 << 16) + 5000),
        &model,
        false,
    );
    assert_eq!((air.a.p, air.b.p), (before.a.p, before.b.p));
}

#[test]
fn forces_are_pressures_times_areas() {
    let model = model();
    let (bore, rod) = (core::f64::consts::PI * 100.0, core::f64::consts::PI * 16.0);
    let [out, back] = model.largest().map(|force| f64::from(force) / 1e3);
    assert!((out - 0.6 * bore).abs() < 0.2, "{out}");
    assert!((back - 0.6 * (bore - rod)).abs() < 0.2, "{back}");
    let mut air = Air::unknown(&model, MIDDLE);
    assert!(air.force(&model).abs() < 100, "{}", air.force(&model));
    air.a.p = SUPPLY;
    assert!((f64::from(air.force(&model)) / 1e3 - out).abs() < 0.2);
    (air.a.p, air.b.p) = (model.ambient, SUPPLY);
    assert!((f64::from(air.force(&model)) / 1e3 + back).abs() < 0.2);
}

#[test]
fn what_has_been_vented_for_certain_is_known() {
    let model = model();
    let mut air = Air::unknown(&model, MIDDLE);
    let vent = |air: &mut Air, ticks, on| {
        (0..ticks).for_each(|_| _ = air.follow(&on, MIDDLE, &model, false));
    };
    // A sixteenth of 18/16 of 1.03 s is 73 ms, and both need it.
    vent(&mut air, 300, [0, 1000, 1000, 0]);
    vent(&mut air, 72, [1000, 0, 0, 1000]);
    assert!(!air.is_comparable(&model));
    // Pulses of 6 ms may not open the valve, however many there are.
    for _ in 0..100 {
        vent(&mut air, 6, [1000, 0, 0, 1000]);
        vent(&mut air, 14, [0; 4]);
    }
    assert!(!air.is_comparable(&model));
    vent(&mut air, 21, [1000, 0, 0, 1000]);
    assert!(air.is_comparable(&model) && !air.is_known(true, &model));
    vent(&mut air, 1050, [1000, 0, 0, 1000]);
    assert!(!air.is_known(true, &model));
    vent(&mut air, 60, [1000, 0, 0, 1000]);
    assert!(air.is_known(true, &model) && !air.is_known(false, &model));
    air.forget();
    assert!(!air.is_comparable(&model) && !air.is_known(true, &model));
}

/// Valves specified to open in 3.5 ms may take 6.3 ms.
#[test]
fn of_a_pulse_that_may_open_nothing_nothing_is_certain() {
    let model = model();
    // Pressure that a pulse every 20 ms brings into A in 0.2 s, bar.
    let gain = |pulse: u32, begin: u32, certain: bool| {
        let mut air = Air::unknown(&model, MIDDLE);
        let before = air.a.p;
        for tick in 0..203 + begin {
            let phase = (tick + 20 - begin) % 20;
            let on = if tick >= begin && tick < 200 + begin && phase < pulse {
                [1000, 0, 0, 0]
            } else {
                [0; 4]
            };
            air.follow(&on, MIDDLE, &model, certain);
        }
        f64::from(air.a.p - before) / f64::from(SUPPLY) * 7.01325
    };
    // Whenever in a round it begins.
    for begin in 0..3 {
        assert_eq!(gain(6, begin, true).to_bits(), 0.0_f64.to_bits(), "{begin}");
        let whole = gain(18, begin, false);
        assert!((gain(6, begin, false) * 3.0 / whole - 1.0).abs() < 0.15);
        // Of 18 ms, 9 to 12 remain.
        let sure = gain(18, begin, true) / whole;
        assert!((0.45..0.72).contains(&sure), "{begin} {sure}");
    }
}

/// Whatever the specified opening time, air counts as certain no sooner than after 9/5 of that time, and at the latest
/// two rounds later, as far as rounds are counted (45 ms): one round for rounding up, and one in which a pulse may
/// begin.
#[test]
fn a_valve_is_open_for_certain_after_nearly_twice_what_it_is_told() {
    for told in [
        0, 1, 1000, 1400, 1666, 1700, 3500, 5000, 25_000, 25_001, 50_000,
    ] {
        let slow = told * SLOWER_FIFTHS / 5;
        let model = of(&AxisData {
            valve_on: Micros(told),
            ..AxisData::default()
        });
        // How much of A's vent time counts, µs: pulses of this many ticks every 150 ms.
        let sure = |pulse: u32, begin: u32| {
            let mut air = Air::unknown(&model, MIDDLE);
            for tick in 0..1500 + begin {
                let vents = tick >= begin && (tick - begin) % 150 < pulse;
                let on = if vents { [0, 1000, 0, 0] } else { [0; 4] };
                air.follow(&on, MIDDLE, &model, true);
            }
            u32::from(air.a.vented) << VENTED_SHIFT
        };
        // Whenever in a round a pulse begins; ten of them, rounded down to 64 µs.
        for begin in 0..ROUND.into() {
            for pulse in [1_u32, 2, 3, 4, 6, 7, 9, 12, 45, 48, 60, 100] {
                let most = 10 * (1000 * pulse).saturating_sub(slow);
                let least = if slow <= 15 * WHOLE {
                    let left = (1000 * pulse).saturating_sub(slow + 2 * WHOLE);
                    10 * left.saturating_sub(64 * pulse)
                } else {
                    0
                };
                let counted = sure(pulse, begin);
                let what = format_args!("{told} {begin} {pulse}: {counted}");
                assert!((least..=most).contains(&counted), "{what} {least} {most}");
                assert!(slow <= 15 * WHOLE || counted == 0, "{what}");
            }
        }
    }
}

#[test]
fn extremes_of_the_parameters_stay_in_their_bounds() {
    for (bore, conductance) in [(4, 20.0), (100, 0.006), (100, 20.0), (4, 0.006)] {
        let data = AxisData {
            bore: PositionMm::from_int(bore),
            rod: PositionMm::from_int(1),
            conductance: wheeleg_control::joint::Gain::from_num(conductance),
            supply: PositionMm::from_int(1700),
            ..AxisData::default()
        };
        let model = of(&data);
        let mut air = Air::unknown(&model, MIDDLE);
        for tick in 0..4000_u32 {
            let on = if tick % 1000 < 500 {
                [1000, 0, 0, 1000]
            } else {
                [0, 1000, 1000, 0]
            };
            let at = PositionMm::from_raw((90 << 16) + (tick % 2) as i32 * STEP);
            air.follow(&on, at, &model, false);
            let bounds = (model.ambient >> 1)..=MOST;
            assert!(bounds.contains(&air.a.p) && bounds.contains(&air.b.p));
        }
    }
}

#[test]
fn a_chamber_may_lose_a_bar_in_4_7_s_down_to_the_atmosphere() {
    let model = model();
    let mut air = Air::unknown(&model, MIDDLE);
    let bar = |p: i32| f64::from(p) / f64::from(SUPPLY) * 7.01325;
    (air.a.p, air.b.p) = (SUPPLY, model.ambient + 100);
    air.leak(&model, 4700 / ROUND);
    assert!((bar(air.a.p) - 6.01).abs() < 0.02, "{}", bar(air.a.p));
    assert_eq!(air.b.p, model.ambient);
    // A pressure below it stays.
    air.b.p = model.ambient / 2;
    air.leak(&model, 1);
    assert_eq!(air.b.p, model.ambient / 2);
    air.leak(&model, u16::MAX);
    assert_eq!(air.a.p, model.ambient);
}

#[test]
fn every_flipped_bit_of_the_account_changes_its_seal() {
    let model = model();
    let mut air = Air::unknown(&model, MIDDLE);
    for (p, vented) in [(0, 0), (0x7_5A5A, 0xA5A5)] {
        (air.a.p, air.a.vented) = (p, vented);
        let sound = Checksum::of(&air);
        for bit in 0..32 {
            let mut damaged = [air; 5];
            damaged[0].a.p ^= 1 << bit;
            damaged[1].a.length ^= 1 << bit;
            damaged[2].a.open ^= 1 << bit;
            damaged[3].a.vented ^= 1 << (bit % 16);
            damaged[4].b.p ^= 1 << bit;
            for (field, damaged) in damaged.iter().enumerate() {
                assert_ne!(Checksum::of(damaged), sound, "{field} {bit}");
            }
        }
    }
}

#[test]
fn a_pulse_fills_a_64th_of_the_supply_or_what_its_shortest_opening_gives() {
    let model = model();
    for (b, supply_n) in [(false, 0.701_325 * 314.16), (true, 0.701_325 * 263.9)] {
        let (least, none) = (Micros::ZERO, Micros(u32::MAX));
        let (time, force) = model.pulse(b, MIDDLE, least, none);
        assert!((f64::from(force) / 1e3 - supply_n / 64.0).abs() < 0.02);
        // What the estimate makes of it: a 64th in choked flow, in ticks of a millisecond.
        let ticks = time.get().div_ceil(1000);
        let mut on = [0; 4];
        on[if b { 2 } else { 0 }] = 1000;
        let [a0, b0] = after(0, on, [1.2, 1.2], &model);
        let [a1, b1] = after(ticks, on, [1.2, 1.2], &model);
        let rise =
            if b { b1 - b0 } else { a1 - a0 } * f64::from(time.get()) / f64::from(ticks * 1000);
        assert!((rise / (7.01325 / 64.0) - 1.0).abs() < 0.03, "{rise}");
        // Longer pulses give more, up to all of the supply; the bounds hold.
        for (times, parts) in [(10, 10), (50, 50), (64, 64), (100, 64)] {
            let shortest = Micros(time.get() * times);
            let (opening, longer) = model.pulse(b, MIDDLE, shortest, none);
            assert_eq!((opening, longer), (shortest, force * parts));
        }
        let (opening, half) = model.pulse(b, MIDDLE, least, Micros(time.get() / 2));
        assert_eq!(opening.get(), time.get() / 2);
        assert!((half - force / 2).abs() <= force / 16, "{half} {force}");
    }
}

#[test]
fn what_moves_the_air_is_more_than_noise_and_no_more_than_a_piston_can() {
    let model = model();
    // Lengths and pressures after three ticks at a stroke that is off by this much.
    let moved = |off: i32| {
        let mut air = Air::unknown(&model, MIDDLE);
        let at = PositionMm::from_raw(MIDDLE.raw() + off);
        for _ in 0..ROUND {
            air.follow(&[0; 4], at, &model, false);
        }
        let lengths = [air.a.length - MIDDLE.raw(), MIDDLE.raw() - air.b.length];
        let ambient = model.ambient;
        (lengths, [air.a.p - ambient, air.b.p - ambient])
    };
    // An eighth of a millimetre.
    for off in [8191, -8191, 0] {
        assert_eq!(moved(off), ([0, 0], [0, 0]));
    }
    for off in [8192, STEP] {
        let (lengths, [a, b]) = moved(off);
        assert_eq!(lengths, [off, off]);
        assert!(a < 0 && b > 0, "{a} {b}");
        let (lengths, [a, b]) = moved(-off);
        assert_eq!(lengths, [-off, -off]);
        assert!(a > 0 && b < 0, "{a} {b}");
    }
    // Beyond 4 mm it is another calibration: the length is taken over, the air stays.
    for off in [STEP + 1, -STEP - 1, 80 << 16] {
        assert_eq!(moved(off), ([off, off], [0, 0]));
    }
}

#[test]
fn more_than_eleven_eighths_of_the_supply_are_impossible_in_either_chamber() {
    let model = model();
    let most = 11 * SUPPLY / 8;
    for (a, b, impossible) in [
        (most, most, false),
        (most + 1, 0, true),
        (0, most + 1, true),
        (SUPPLY, SUPPLY, false),
    ] {
        let mut air = Air::unknown(&model, MIDDLE);
        (air.a.p, air.b.p) = (a, b);
        assert_eq!(air.is_impossible(), impossible, "{a} {b}");
    }
}
