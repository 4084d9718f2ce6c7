//! Relations of a few fields that are more than an order.

use wheeleg_master::contact::Side;
use wheeleg_master::layer1::params::{ParamError, Pattern};

use super::{Broken, Facts, ROUNDING, Relation};
use crate::gait::GaitParams;
use crate::params::{FieldSpec, Params as _};
use crate::quantity::{Dimension, brief, pretty};
use crate::told::STEPS_AT_REST;

/// Shares of its track between which a wiper stands: beyond, a board takes it for torn off or
/// shorted. As a commissioned board is told.
pub const SENSOR_TRACK: [f64; 2] = [0.01, 0.99];

fn broken(figures: String, allowed: String) -> Option<Broken> {
    Some(Broken { figures, allowed })
}

/// The pressure at which the regulator is fully open is above the surroundings.
pub(super) fn droop(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [droop, set, ambient] = [0, 1, 2].map(|i| f.si(it.fields[i]));
    let most_pa = set? - ambient?;
    if droop? < most_pa || most_pa <= 0.0 {
        return None;
    }
    broken(
        String::new(),
        format!(
            "`supply.droop` is allowed below {}, which is `supply.set_pressure` − \
             `gas.ambient_pressure`",
            f.told("supply.droop", most_pa)
        ),
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
    let path = it.fields[0];
    let shorter_m = (most_m - offset_m) / gain;
    let or = match shorter_m > 0.0 {
        true => format!(
            ", or `{}` up to {}",
            it.fields[1],
            f.told(it.fields[1], shorter_m)
        ),
        false => String::new(),
    };
    broken(
        format!(
            "with the rod out it stands at {} of {}",
            f.told(path, reach_m),
            f.told(path, electrical_m)
        ),
        format!(
            "`{path}` is allowed from {}{or}",
            f.told(path, (reach_m / SENSOR_TRACK[1] * 1e4).ceil() * 1e-4)
        ),
    )
}

/// The wiper stands on its track with the rod in.
pub(super) fn begin(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let least_m = SENSOR_TRACK[0] * f.si(it.fields[1])?;
    if f.si(it.fields[0])? >= least_m * (1.0 - ROUNDING) {
        return None;
    }
    broken(
        String::new(),
        format!(
            "`{}` is allowed from {}",
            it.fields[0],
            f.told(it.fields[0], least_m)
        ),
    )
}

/// A push ends within its step, as the master has it.
pub(super) fn push(f: &Facts<'_>, _: &Relation) -> Option<Broken> {
    let value = |spec: &FieldSpec| match spec.dimension {
        Dimension::Flag => Some(vec![0.0]),
        _ => Some(vec![f.si(&format!("gait.{}", spec.key))?]),
    };
    let values: Option<Vec<Vec<f64>>> = GaitParams::FIELDS.iter().map(value).collect();
    let mut values = values?.into_iter();
    let gait = GaitParams::build(&mut || values.next().unwrap_or_default());
    // The longest push; which leg steps does not matter.
    let mut found = gait.of_master(Pattern::Single(Side::Left)).violations();
    let error = found.find(|error| matches!(error, ParamError::PushTooLong { .. }))?;
    let ParamError::PushTooLong { needs_us, has_us } = error else {
        return None;
    };
    let seconds = |us: u32| pretty(f64::from(us) * 1e-6);
    broken(
        format!(
            "with this stroke, speed and acceleration it takes {} s, and there are {} s",
            seconds(needs_us),
            seconds(has_us)
        ),
        format!(
            "`gait.period` is allowed from {} s after `gait.push`; or a faster push",
            seconds(needs_us)
        ),
    )
}

/// Of the three principal inertias of a body none exceeds the sum of the others: each is a
/// sum of two of ∫x² dm, ∫y² dm, ∫z² dm.
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
            f.told(it.fields[0], -radius_m),
            it.fields[1]
        ),
    )
}

/// What a track must be for a chassis that reaches so far to a side.
fn wide_enough(f: &Facts<'_>, half_m: f64) -> Option<Broken> {
    let (track_m, width_m) = (f.si("spatial.track")?, f.si("spatial.wheel_width")?);
    let least_m = 2.0 * half_m + width_m;
    if track_m >= least_m * (1.0 - ROUNDING) {
        return None;
    }
    broken(
        String::new(),
        format!(
            "`spatial.track` is allowed from {}: the width of the chassis and that of a wheel",
            f.told("spatial.track", least_m)
        ),
    )
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

/// A potentiometer with the piston in a stop, and how its board reads it.
struct Calibrated {
    electrical_m: f64,
    offset_m: f64,
    gain: f64,
    stroke_m: f64,
}

/// Codes of the whole converter.
const CODES: f64 = 65_536.0;

impl Calibrated {
    /// From the first fields of a relation. Where a kind of joint has a calibration of its own, that
    /// of all says nothing.
    fn of(f: &Facts<'_>, it: &Relation) -> Option<Self> {
        let own = |kind: &&str| {
            let mut paths = f.parameters.iter().map(|p| p.path.as_str());
            paths.any(|path| path.starts_with(&format!("node.{kind}.sensor_")))
        };
        if ["yaw", "horizontal", "vertical"].iter().any(own) {
            return None;
        }
        let [electrical, offset, gain, stroke] = [0, 1, 2, 3].map(|i| f.si(it.fields[i]));
        Some(Self {
            electrical_m: electrical?,
            offset_m: offset?,
            gain: gain?,
            stroke_m: stroke?,
        })
    }

    /// Share of the track at both stops.
    fn shares(&self) -> [f64; 2] {
        [0.0, self.stroke_m].map(|at_m| (self.offset_m + self.gain * at_m) / self.electrical_m)
    }

    /// What a board measures at both stops, in the unit of its full scale.
    fn measured(&self, full_scale_mm: f64, zero: f64) -> [f64; 2] {
        self.shares()
            .map(|share| (share - zero / CODES) * full_scale_mm)
    }

    /// A board that measures what is.
    fn advice(&self) -> String {
        format!(
            "a calibrated board has `sensor_full_scale` = {} mm and `sensor_zero` = {}",
            pretty(self.electrical_m / self.gain * 1e3),
            (self.offset_m / self.electrical_m * CODES)
                .round()
                .clamp(0.0, CODES - 1.0)
        )
    }

    fn told(&self, [inside, out]: [f64; 2], unit: &str) -> String {
        let stroke = pretty(self.stroke_m * 1e3);
        let (inside, out) = (brief(inside), brief(out));
        format!("strokes of 0 and {stroke} mm are measured as {inside} and {out} {unit}")
    }
}

/// What a joint board reads at both stops are codes that it allows.
pub(super) fn codes(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let sensor = Calibrated::of(f, it)?;
    let (least, most) = (f.si(it.fields[4])?, f.si(it.fields[5])?);
    let codes = sensor.shares().map(|share| share * CODES);
    if codes[0] >= least && codes[1] <= most {
        return None;
    }
    let allowed = format!(
        "allowed are codes from {} to {}",
        pretty(least),
        pretty(most)
    );
    broken(sensor.told(codes, "of 65536 codes"), allowed)
}

/// What a joint board measures at both stops is a travel that it allows.
pub(super) fn calibration(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let sensor = Calibrated::of(f, it)?;
    let measured = sensor.measured(f.si(it.fields[4])?, f.si(it.fields[5])?);
    let (least, most) = (f.si(it.fields[6])?, f.si(it.fields[7])?);
    if measured[0] >= least && measured[1] <= most {
        return None;
    }
    let range = format!("{} to {} mm", pretty(least), pretty(most));
    let allowed = format!("allowed are {range}; {}", sensor.advice());
    broken(sensor.told(measured, "mm"), allowed)
}

/// A joint that is drawn in, and one that stands out for the gait, measure as settled.
pub(super) fn measured(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let sensor = Calibrated::of(f, it)?;
    let measured = sensor.measured(f.si(it.fields[4])?, f.si(it.fields[5])?);
    let out_mm = f.si(it.fields[6])? * 1e3;
    let tolerance_mm = f.si(it.fields[7])? * 1e3;
    if measured[0] <= tolerance_mm && measured[1] >= out_mm - tolerance_mm {
        return None;
    }
    let allowed = format!(
        "allowed are up to {} mm with the rod in and from {} mm with it out, `homing.tolerance` from \
         the pose; {}",
        pretty(tolerance_mm),
        pretty(out_mm - tolerance_mm),
        sensor.advice()
    );
    broken(sensor.told(measured, "mm"), allowed)
}

/// A joint rests in a band of some steps of its converter.
pub(super) fn converter(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [bits, electrical, band] = [0, 1, 2].map(|i| f.si(it.fields[i]));
    let (electrical_m, band_m) = (electrical?, band? * 1e-3);
    let least_m = STEPS_AT_REST * electrical_m / bits?.exp2();
    if band_m >= least_m {
        return None;
    }
    let most_bits = (STEPS_AT_REST * electrical_m / band_m).log2().ceil();
    let bits = match most_bits <= 16.0 {
        true => format!("`{}` is allowed from {most_bits} bit, or ", it.fields[0]),
        false => String::new(),
    };
    broken(
        String::new(),
        format!(
            "{bits}`{}` is allowed from {} mm: {STEPS_AT_REST} steps",
            it.fields[2],
            pretty((least_m * 1e6).ceil() * 1e-3)
        ),
    )
}
