//! Relations of a few fields that are more than an order of size.

use wheeleg_master::contact::Side;
use wheeleg_master::layer1::params::{GaitParams as MasterGait, ParamError, Pattern};
use wheeleg_master::layer1::square::GUARD_MM;
use wheeleg_plant::body::MOTOR_CURRENT_A;

use super::{Bound, Broken, Facts, Offer, ROUNDING, Relation};
use crate::gait::GaitParams;
use crate::law::PREDICTIVE;
use crate::params::{FieldSpec, Params as _};
use crate::quantity::{Dimension, brief, pretty};

/// Range of a wiper on its track, as shares of the track: beyond it, a board takes the sensor for torn off or
/// shorted. Same as in a commissioned board.
pub const SENSOR_TRACK: [f64; 2] = [0.01, 0.99];

/// An error that no single field can mend.
fn broken(figures: String, words: String) -> Option<Broken> {
    Some(Broken {
        figures,
        offers: Vec::new(),
        words,
    })
}

/// Values of one field each, any of which would do.
pub(super) fn offered(figures: String, offers: Vec<Offer>) -> Option<Broken> {
    Some(Broken {
        figures,
        offers: offers.into_iter().map(|offer| vec![offer]).collect(),
        words: String::new(),
    })
}

/// The pressure at which the regulator is fully open is above the surroundings.
pub(super) fn droop(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [droop, set, ambient] = [0, 1, 2].map(|i| f.si(it.fields[i]));
    let (droop_pa, set_pa, ambient_pa) = (droop?, set?, ambient?);
    if droop_pa < set_pa - ambient_pa || set_pa <= ambient_pa {
        return None;
    }
    let [droop, set, ambient] = [0, 1, 2].map(|i| it.fields[i]);
    offered(
        String::new(),
        vec![
            Offer::new(f, droop, Bound::Below, set_pa - ambient_pa)
                .which_is(&format!("`{set}` − `{ambient}`")),
            Offer::new(f, set, Bound::Above, droop_pa + ambient_pa)
                .which_is(&format!("`{droop}` + `{ambient}`")),
        ],
    )
}

/// Largest deviation of a gas's density from that of an ideal one, share: tables are rounded.
const DENSITY: f64 = 0.05;

/// Density, pressure, gas constant and temperature of the reference belong to one gas.
pub(super) fn density(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [density, pressure, constant, temperature] = [0, 1, 2, 3].map(|i| f.si(it.fields[i]));
    let (density, pressure, constant, temperature) = (density?, pressure?, constant?, temperature?);
    let ideal = pressure / (constant * temperature);
    let share = density / ideal;
    let (low, high) = (1.0 - DENSITY, 1.0 + DENSITY);
    if (low - ROUNDING..=high + ROUNDING).contains(&share) {
        return None;
    }
    // Each field alone, up to the allowed share.
    let (near, bounds) = match share < low {
        true => (low, [Bound::From, Bound::UpTo, Bound::From, Bound::From]),
        false => (high, [Bound::UpTo, Bound::From, Bound::UpTo, Bound::UpTo]),
    };
    let more = near / share;
    let limits = [
        density * more,
        pressure / more,
        constant * more,
        temperature * more,
    ];
    let offers = it.fields.iter().zip(bounds).zip(limits);
    offered(
        format!(
            "pressure / (constant × temperature) is {} kg/m3, of which {} to {} times are allowed",
            brief(ideal),
            brief(low),
            brief(high)
        ),
        offers
            .map(|((path, bound), si)| Offer::new(f, path, bound, si))
            .collect(),
    )
}

/// A motor draws no more current than its model allows, driven against its supply at full speed.
pub(super) fn current(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [resistance, supply] = [0, 1].map(|i| f.si(it.fields[i]));
    let (resistance_ohm, supply_v) = (resistance?, supply?);
    let current_a = 2.0 * supply_v / resistance_ohm;
    if current_a <= MOTOR_CURRENT_A {
        return None;
    }
    let [resistance, supply] = [0, 1].map(|i| it.fields[i]);
    offered(
        format!(
            "driven against its supply at full speed it draws {} A, and {} are allowed",
            brief(current_a),
            brief(MOTOR_CURRENT_A)
        ),
        vec![
            Offer::new(f, resistance, Bound::From, 2.0 * supply_v / MOTOR_CURRENT_A),
            Offer::new(
                f,
                supply,
                Bound::UpTo,
                0.5 * MOTOR_CURRENT_A * resistance_ohm,
            ),
        ],
    )
}

/// The friction of a motor is below the torque with which it stalls.
pub(super) fn stall(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [friction, supply, constant, resistance] = [0, 1, 2, 3].map(|i| f.si(it.fields[i]));
    let (friction, supply, constant, resistance) = (friction?, supply?, constant?, resistance?);
    let stall_n_m = constant * supply / resistance;
    if friction < stall_n_m {
        return None;
    }
    let [friction_at, supply_at, constant_at, resistance_at] = [0, 1, 2, 3].map(|i| it.fields[i]);
    offered(
        format!("it stalls with {}", f.format(friction_at, stall_n_m)),
        vec![
            Offer::new(f, friction_at, Bound::Below, stall_n_m),
            Offer::new(f, supply_at, Bound::Above, friction * resistance / constant),
            Offer::new(f, constant_at, Bound::Above, friction * resistance / supply),
            Offer::new(f, resistance_at, Bound::Below, constant * supply / friction),
        ],
    )
}

/// The wheels can roll as fast as the gait pushes, without load.
pub(super) fn rolling(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [speed, supply, constant, reduction, radius] = [0, 1, 2, 3, 4].map(|i| f.si(it.fields[i]));
    let (speed, supply, constant) = (speed?, supply?, constant?);
    let (reduction, radius) = (reduction?, radius?);
    let most = supply * radius / (constant * reduction);
    if speed <= most * (1.0 + ROUNDING) {
        return None;
    }
    let more = speed / most;
    let [speed_at, supply_at, constant_at, reduction_at, radius_at] =
        [0, 1, 2, 3, 4].map(|i| it.fields[i]);
    offered(
        format!(
            "without load they roll at {} at most",
            f.format(speed_at, most)
        ),
        vec![
            Offer::new(f, speed_at, Bound::UpTo, most),
            Offer::new(f, supply_at, Bound::From, supply * more),
            Offer::new(f, constant_at, Bound::UpTo, constant / more),
            Offer::new(f, reduction_at, Bound::UpTo, reduction / more),
            Offer::new(f, radius_at, Bound::From, radius * more),
        ],
    )
}

/// The wiper stays on its track over the whole stroke.
pub(super) fn track(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [electrical, stroke, offset, gain] = [0, 1, 2, 3].map(|i| f.si(it.fields[i]));
    let (electrical_m, stroke_m, offset_m, gain) = (electrical?, stroke?, offset?, gain?);
    let (reach_m, most_m) = (offset_m + gain * stroke_m, SENSOR_TRACK[1] * electrical_m);
    if reach_m <= most_m * (1.0 + ROUNDING) {
        return None;
    }
    let least_m = (reach_m / SENSOR_TRACK[1] * 1e4).ceil() * 1e-4;
    let mut offers = vec![
        Offer::new(f, it.fields[0], Bound::From, least_m),
        Offer::new(f, it.fields[1], Bound::UpTo, (most_m - offset_m) / gain),
    ];
    // With the rod in, too, it stands on its track.
    let most_offset_m = most_m - gain * stroke_m;
    if most_offset_m >= SENSOR_TRACK[0] * electrical_m {
        offers.push(Offer::new(f, it.fields[2], Bound::UpTo, most_offset_m));
    }
    offered(
        format!(
            "with the rod out it stands at {} of {}",
            f.format(it.fields[0], reach_m),
            f.format(it.fields[0], electrical_m)
        ),
        offers,
    )
}

/// The wiper is on its track with the rod in.
pub(super) fn begin(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let (offset_m, electrical_m) = (f.si(it.fields[0])?, f.si(it.fields[1])?);
    let least_m = SENSOR_TRACK[0] * electrical_m;
    if offset_m >= least_m * (1.0 - ROUNDING) {
        return None;
    }
    offered(
        String::new(),
        vec![
            Offer::new(f, it.fields[0], Bound::From, least_m),
            Offer::new(f, it.fields[1], Bound::UpTo, offset_m / SENSOR_TRACK[0]),
        ],
    )
}

/// The gait in the master's form, if the fields of this relation can be read.
fn gait(f: &Facts<'_>, it: &Relation) -> Option<MasterGait> {
    it.fields.iter().try_for_each(|path| f.si(path).map(drop))?;
    // Other fields, which may be unreadable, have no part in the relation.
    let value = |spec: &FieldSpec| match spec.dimension {
        Dimension::Flag => vec![0.0],
        _ => vec![f.si(&format!("gait.{}", spec.key)).unwrap_or(spec.min)],
    };
    let mut values = GaitParams::FIELDS.iter().map(value);
    let gait = GaitParams::build(&mut || values.next().unwrap_or_default());
    // The longest push; which leg steps does not matter.
    Some(gait.of_master(Pattern::Single(Side::Left)))
}

/// A push ends within its step, by the master's own calculation.
pub(super) fn push(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let (needs_us, has_us) = gait(f, it)?.violations().find_map(|error| match error {
        ParamError::PushTooLong { needs_us, has_us } => Some((needs_us, has_us)),
        _ => None,
    })?;
    let seconds = |us: u32| pretty(f64::from(us) * 1e-6);
    let [period, push, stroke, speed, acceleration] = [0, 1, 2, 3, 4].map(|i| it.fields[i]);
    let (period_s, push_s) = (f.si(period)?, f.si(push)?);
    let needs_s = f64::from(needs_us) * 1e-6;
    let mut offers = vec![
        Offer::new(f, period, Bound::From, push_s + needs_s),
        Offer::new(f, push, Bound::UpTo, period_s - needs_s),
    ];
    // The speed v at which a trapezoid takes the available time t: s/v + v/a = t.
    let (s, a, t) = (f.si(stroke)?, f.si(acceleration)?, period_s - push_s);
    let root = a * t * a * t - 4.0 * a * s;
    if root >= 0.0 {
        // A thousandth more, as the master counts in whole steps.
        let v = 1.001 * 0.5 * (a * t - root.sqrt());
        offers.push(Offer::new(f, speed, Bound::From, (v * 1e4).ceil() * 1e-4));
    }
    offered(
        format!(
            "with this stroke, speed and acceleration it takes {} s, and there are {} s",
            seconds(needs_us),
            seconds(has_us)
        ),
        offers,
    )
}

/// The slow descent of a foot to the ground ends before the push begins, by the master's own calculation.
pub(super) fn touchdown(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [speed, lower, push, stroke] = [0, 1, 2, 3].map(|i| it.fields[i]);
    let gait = gait(f, it)?;
    let too_slow = |error| matches!(error, ParamError::TouchdownTooSlow { .. });
    gait.violations().any(too_slow).then_some(())?;
    let (speed_m_s, lower_s, push_s) = (f.si(speed)?, f.si(lower)?, f.si(push)?);
    let slow_way_mm = gait.slow_way_mm();
    let (has_s, slow_way_m) = (push_s - lower_s, slow_way_mm.to_f64() * 1e-3);
    let needs_s = slow_way_m / speed_m_s;
    let mut offers = vec![
        Offer::new(f, speed, Bound::Above, slow_way_m / has_s),
        Offer::new(f, speed, Bound::At, 0.0).which_is("a jump of the reference"),
        Offer::new(f, push, Bound::Above, lower_s + needs_s),
        Offer::new(f, lower, Bound::Below, push_s - needs_s),
    ];
    if slow_way_mm < GUARD_MM {
        offers.push(Offer::new(f, stroke, Bound::Below, speed_m_s * has_s));
    }
    offered(
        format!(
            "the last {} mm take {} s, and there are {} s",
            brief(slow_way_mm.to_f64()),
            brief(needs_s),
            brief(has_s)
        ),
        offers,
    )
}

/// None of the three principal inertias of a body exceeds the sum of the others: each is a sum of two of ∫x²
/// dm, ∫y² dm, ∫z² dm.
fn inertias(inertia_kg_m2: [f64; 3]) -> Option<Broken> {
    let sum: f64 = inertia_kg_m2.iter().sum();
    let largest = inertia_kg_m2.into_iter().fold(0.0, f64::max);
    let others = sum - largest;
    if largest <= others * (1.0 + ROUNDING) {
        return None;
    }
    broken(
        format!(
            "the largest, {} kg m2, exceeds the sum of the others, {} kg m2",
            brief(largest),
            brief(others)
        ),
        "none is allowed above the sum of the others: a thin rod has two equal ones and the third \
         near 0; a plate has one equal to that sum"
            .to_owned(),
    )
}

pub(super) fn chassis_inertias(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [a, b, c] = [0, 1, 2].map(|i| f.si(it.fields[i]));
    inertias([a?, b?, c?])
}

pub(super) fn wheel_inertias(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let (axle, across) = (f.si(it.fields[0])?, f.si(it.fields[1])?);
    inertias([axle, across, across])
}

pub(super) fn link_inertias(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    inertias(f.list(it.fields[0])?)
}

/// Denser than any metal used in robots, kg/m³: tungsten and gold have 19,300.
const DENSEST_KG_M3: f64 = 2e4;

/// A body of a mass has a size, and so inertias. A ball has the smallest ones for its mass: no body's largest
/// inertia is below that of a ball. A long body may be thin: its smallest inertia is at least that of a rod
/// whose length follows from the largest one.
fn size(inertia_kg_m2: [f64; 3], mass_kg: f64) -> Option<Broken> {
    use std::f64::consts::PI;
    let largest = inertia_kg_m2.into_iter().fold(0.0, f64::max);
    let smallest = inertia_kg_m2.into_iter().fold(f64::INFINITY, f64::min);
    let radius_m = (3.0 * mass_kg / (4.0 * PI * DENSEST_KG_M3)).cbrt();
    let ball = 0.4 * mass_kg * radius_m * radius_m;
    // Of a rod: m l²/12 across, m r²/2 along, and its mass is ρ π r² l.
    let length_m = (12.0 * largest / mass_kg).sqrt();
    let along = mass_kg * mass_kg / (2.0 * PI * DENSEST_KG_M3 * length_m);
    // As printed, on its own side.
    let upwards = |value: f64| 1.001 * value;
    let tonnes = brief(DENSEST_KG_M3 * 1e-3);
    if largest < ball {
        return broken(
            format!(
                "the largest, {} kg m2, is below that of a ball of {} kg and {tonnes} t/m3",
                brief(largest),
                brief(mass_kg)
            ),
            format!(
                "allowed are from {} kg m2 for each of the three, or less mass",
                brief(upwards(ball))
            ),
        );
    }
    (smallest < along).then_some(())?;
    broken(
        format!(
            "the smallest, {} kg m2, is below that of a rod of {} kg, {tonnes} t/m3 and {} m, which is \
             as long as the largest says",
            brief(smallest),
            brief(mass_kg),
            brief(length_m)
        ),
        format!(
            "allowed is the smallest from {} kg m2 beside this largest one, or less mass",
            brief(upwards(along))
        ),
    )
}

pub(super) fn chassis_size(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [a, b, c, mass] = [0, 1, 2, 3].map(|i| f.si(it.fields[i]));
    size([a?, b?, c?], mass?)
}

pub(super) fn wheel_size(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [axle, across, mass] = [0, 1, 2].map(|i| f.si(it.fields[i]));
    size([axle?, across?, across?], mass?)
}

pub(super) fn link_size(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    size(f.list(it.fields[0])?, f.si(it.fields[1])?)
}

/// A box has a size.
pub(super) fn corners(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let (from, to) = (f.list::<3>(it.fields[0])?, f.list::<3>(it.fields[1])?);
    if from.iter().zip(&to).all(|(from, to)| from <= to) {
        return None;
    }
    broken(
        String::new(),
        "each value of `from` is allowed up to that of `to`: rear to front, right to left, lower \
         to upper"
            .to_owned(),
    )
}

/// The wheels, not the chassis, stand on level ground.
pub(super) fn belly(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [.., up_m] = f.list::<3>(it.fields[0])?;
    let radius_m = f.si(it.fields[1])?;
    if up_m > -radius_m {
        return None;
    }
    broken(
        String::new(),
        format!(
            "the third value of `{}`, up from the axle, is allowed above {}, which is \
             −`{}`",
            it.fields[0],
            f.format(it.fields[0], -radius_m),
            it.fields[1]
        ),
    )
}

/// The smallest track for a chassis that reaches this far to a side.
fn wide_enough(f: &Facts<'_>, half_m: f64) -> Option<Broken> {
    let (track_m, width_m) = (f.si("spatial.track")?, f.si("spatial.wheel_width")?);
    let least_m = 2.0 * half_m + width_m;
    if track_m >= least_m * (1.0 - ROUNDING) {
        return None;
    }
    let offers = [
        Offer::new(f, "spatial.track", Bound::From, least_m)
            .which_is("the width of the chassis and that of a wheel"),
        Offer::new(
            f,
            "spatial.wheel_width",
            Bound::UpTo,
            track_m - 2.0 * half_m,
        ),
    ];
    offered(String::new(), offers.to_vec())
}

/// A chassis that is not above, before or behind the wheels is between them.
pub(super) fn between(f: &Facts<'_>, _: &Relation) -> Option<Broken> {
    let from = f.list::<3>("chassis_contact.from")?;
    let to = f.list::<3>("chassis_contact.to")?;
    let radius_m = f.si("body.wheel_radius")?;
    let beside = |i: usize| from[i] < radius_m && to[i] > -radius_m;
    if !(beside(0) && beside(2)) {
        return None;
    }
    wide_enough(f, from[1].abs().max(to[1].abs()))
}

pub(super) fn drawn(f: &Facts<'_>, _: &Relation) -> Option<Broken> {
    let [_, wide_m, _] = f.list::<3>("spatial.chassis_size")?;
    wide_enough(f, 0.5 * wide_m)
}

/// Hips are on their own sides, between the wheels.
pub(super) fn hips(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [_, left_m, _] = f.list::<3>(it.fields[0])?;
    let half_m = 0.5 * f.si(it.fields[1])?;
    if left_m > 0.0 && left_m <= half_m * (1.0 + ROUNDING) {
        return None;
    }
    let wider = || f.offer(it.fields[1], Bound::From, 2.0 * left_m);
    Some(Broken {
        figures: String::new(),
        offers: (left_m > 0.0).then(wider).into_iter().collect(),
        words: format!(
            "the second value of `{}`, left of the middle, is allowed above 0 and up to {}, half of `{}`",
            it.fields[0],
            f.format(it.fields[0], half_m),
            it.fields[1]
        ),
    })
}

/// Gravity points to the ground.
pub(super) fn gravity(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [forward, left, up] = f.list::<3>(it.fields[0])?;
    let along = (forward * forward + left * left).sqrt();
    if up < 0.0 && along < -up {
        return None;
    }
    broken(
        String::new(),
        "the third value, normal to the ground, is allowed below 0, and larger than the others \
         together: [0.0, 0.0, -9.81] on level ground"
            .to_owned(),
    )
}

/// Within the first distance of the configured end of the stroke, a board with a precharge presses its piston
/// against the stop, mm; within the second of the stop it takes the piston for pressed (`SEAT_TARGET` and
/// `SEATED_WITHIN` of the predictive law).
pub const SEAT_MM: [f64; 2] = [0.5, 1.5];

/// The stop against which a board presses is at its configured place.
pub(super) fn seat(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    // If a kind of joint has its own values, those for all joints do not count.
    let own = |path: &str| {
        let key = path.rsplit_once('.').map_or(path, |(_, key)| key);
        let mut kinds = ["yaw", "horizontal", "vertical"].into_iter();
        kinds.any(|kind| f.info(&format!("node.{kind}.{key}")).is_some())
    };
    let [stroke, told, gait, precharge, law] = [0, 1, 2, 3, 4].map(|i| it.fields[i]);
    if [told, precharge, law].into_iter().any(own) {
        return None;
    }
    let (stroke_mm, told_mm, gait_mm) = (f.si(stroke)? * 1e3, f.si(told)?, f.si(gait)? * 1e3);
    let is_pressed = f.si(law)? == f64::from(PREDICTIVE)
        && f.si(precharge)? > 0.0
        && gait_mm > told_mm - SEAT_MM[0];
    let most_mm = told_mm + SEAT_MM[1];
    if !is_pressed || stroke_mm <= most_mm * (1.0 + ROUNDING) {
        return None;
    }
    offered(
        format!(
            "the board presses a piston at {} mm outwards, and the stop is at {} mm",
            pretty(told_mm),
            pretty(stroke_mm)
        ),
        vec![
            Offer::new(f, told, Bound::At, stroke_mm),
            Offer::new(f, stroke, Bound::UpTo, most_mm * 1e-3),
            Offer::new(f, gait, Bound::UpTo, (told_mm - SEAT_MM[0]) * 1e-3),
        ],
    )
}

/// The field that sets a parameter for a kind of board, its own or that for all boards, and its value.
fn decides<'a>(f: &Facts<'_>, own: &'a str, all: &'a str) -> Option<(&'a str, f64)> {
    let found = |path| f.si(path).map(|value| (path, value));
    found(own).or_else(|| found(all))
}

/// The gait keeps its pistons within the limits set in their boards, to the settling tolerance.
pub(super) fn reach(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    reached(f, it, &[])
}

/// The same for pistons that the gait also draws in.
pub(super) fn reach_from_home(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    reached(f, it, &[0.0])
}

fn reached(f: &Facts<'_>, it: &Relation, home_mm: &[f64]) -> Option<Broken> {
    let (most, most_mm) = decides(f, it.fields[0], it.fields[2])?;
    let (least, least_mm) = decides(f, it.fields[1], it.fields[3])?;
    let tolerance_mm = f.si(it.fields[4])? * 1e3;
    let gait = it.fields[5..]
        .iter()
        .map(|path| f.si(path).map(|m| m * 1e3));
    let mut needed_mm = gait.collect::<Option<Vec<f64>>>()?;
    needed_mm.extend(home_mm);
    let low_mm = needed_mm.iter().copied().fold(f64::INFINITY, f64::min);
    let high_mm = needed_mm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut offers = Vec::new();
    if least_mm > low_mm + tolerance_mm {
        offers.push(Offer::new(f, least, Bound::UpTo, low_mm));
    }
    if most_mm < high_mm - tolerance_mm {
        offers.push(Offer::new(f, most, Bound::From, high_mm));
    }
    if offers.is_empty() {
        return None;
    }
    let figures = format!(
        "{} to {} mm are needed, and {} to {} mm allowed",
        pretty(low_mm),
        pretty(high_mm),
        pretty(least_mm),
        pretty(most_mm)
    );
    // Both ends if both are wrong.
    Some(Broken {
        figures,
        offers: vec![offers],
        words: String::new(),
    })
}

/// A board accepts measured speeds as high as those it commands.
pub(super) fn credible(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let (rate, rate_mm_s) = decides(f, it.fields[0], it.fields[1])?;
    let (slew, slew_mm_s) = decides(f, it.fields[2], it.fields[3])?;
    if rate_mm_s >= slew_mm_s {
        return None;
    }
    offered(
        String::new(),
        vec![
            Offer::new(f, rate, Bound::From, slew_mm_s).which_is(&format!("`{slew}`")),
            Offer::new(f, slew, Bound::UpTo, rate_mm_s).which_is(&format!("`{rate}`")),
        ],
    )
}

/// Smallest timer with which a wheel board makes profiles (HCTL-1100 data sheet, sample timer).
const PROFILE_TIMER: f64 = 15.0;

/// A wheel board that makes its own profiles has enough time for it.
pub(super) fn profiles(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let (timer, streamed) = (f.si(it.fields[0])?, f.si(it.fields[1])?);
    if timer >= PROFILE_TIMER || streamed != 0.0 {
        return None;
    }
    offered(
        String::new(),
        vec![Offer::new(f, it.fields[0], Bound::From, PROFILE_TIMER)],
    )
}
