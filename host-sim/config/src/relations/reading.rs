//! How a joint board reads its potentiometer: codes, strokes, noise.

use super::laws::offered;
use super::{Bound, Broken, Facts, Offer, Relation};
use crate::derived::STEPS_AT_REST;
use crate::quantity::{brief, pretty};

/// A potentiometer with the piston at a stop, and its board's reading.
struct Calibrated {
    electrical_m: f64,
    offset_m: f64,
    gain: f64,
    stroke_m: f64,
}

/// Peaks of noise, in standard deviations.
const NOISE_PEAKS: f64 = 6.0;
/// Codes of the whole converter.
const CODES: f64 = 65_536.0;

impl Calibrated {
    /// From the first fields of a relation. If a kind of joint has its own calibration, that for all joints
    /// does not count.
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

    /// Strokes that a board measures at both stops, in the unit of its full scale.
    fn measured(&self, full_scale_mm: f64, zero: f64) -> [f64; 2] {
        self.shares()
            .map(|share| (share - zero / CODES) * full_scale_mm)
    }

    /// The stroke that a board measures as `measured_mm`.
    fn stroke_at(&self, measured_mm: f64, full_scale_mm: f64, zero: f64) -> f64 {
        self.stroke_of(measured_mm / full_scale_mm + zero / CODES)
    }

    /// The stroke at which the wiper is at a share of its track.
    fn stroke_of(&self, share: f64) -> f64 {
        (share * self.electrical_m - self.offset_m) / self.gain
    }

    /// Offers for a board that measures the true stroke.
    fn calibrated(&self, f: &Facts<'_>, it: &Relation) -> Vec<Offer> {
        let full_scale_mm = self.electrical_m / self.gain * 1e3;
        let zero = (self.offset_m / self.electrical_m * CODES).round();
        vec![
            Offer::new(f, it.fields[4], Bound::At, full_scale_mm),
            Offer::new(f, it.fields[5], Bound::At, zero.clamp(0.0, CODES - 1.0)),
        ]
    }

    fn format(&self, [inside, out]: [f64; 2], unit: &str) -> String {
        let stroke = pretty(self.stroke_m * 1e3);
        let (inside, out) = (brief(inside), brief(out));
        format!("strokes of 0 and {stroke} mm are measured as {inside} and {out} {unit}")
    }
}

/// Largest error of a reading, as a share of the track: from the sensor's nonlinearity, and from the
/// converter's noise.
fn reading_error(f: &Facts<'_>, [nonlinearity, noise, bits]: [&str; 3]) -> Option<f64> {
    Some(f.si(nonlinearity)? + NOISE_PEAKS * f.si(noise)? / f.si(bits)?.exp2())
}

/// The noise with which a reading is off by a share of the track at most, if any is small enough.
fn less_noise(
    f: &Facts<'_>,
    [nonlinearity, noise, bits]: [&str; 3],
    share: f64,
) -> Option<Vec<Offer>> {
    let most = (share - f.si(nonlinearity)?) * f.si(bits)?.exp2() / NOISE_PEAKS;
    let most = (most * 1e3).floor() * 1e-3;
    (most >= 0.0).then(|| f.offer(noise, Bound::UpTo, most))
}

/// A joint board's readings at both stops are codes that it allows.
pub(super) fn codes(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let sensor = Calibrated::of(f, it)?;
    let (least, most) = (f.si(it.fields[4])?, f.si(it.fields[5])?);
    let reading = [6, 7, 8].map(|i| it.fields[i]);
    let off = reading_error(f, reading)?;
    let codes = sensor.shares().map(|share| share * CODES);
    let beside = off * CODES;
    let is_held = [codes[0] - beside >= least, codes[1] + beside <= most];
    if is_held == [true, true] {
        return None;
    }
    // The part of the track that the board allows, less the error of its readings.
    let (low, high) = (least / CODES + off, most / CODES - off);
    let room = f64::min(codes[0] - least, most - codes[1]) / CODES;
    let mut offers: Vec<Vec<Offer>> = less_noise(f, reading, room).into_iter().collect();
    if !is_held[0] {
        offers.push(vec![Offer::new(
            f,
            it.fields[4],
            Bound::UpTo,
            (codes[0] - beside).floor(),
        )]);
        let most_m = ((sensor.offset_m / low) * 1e4).floor() * 1e-4;
        offers.push(vec![Offer::new(f, it.fields[0], Bound::UpTo, most_m)]);
        let least_m = (low * sensor.electrical_m * 1e4).ceil() * 1e-4;
        offers.push(vec![Offer::new(f, it.fields[1], Bound::From, least_m)]);
    }
    if !is_held[1] {
        offers.push(vec![Offer::new(
            f,
            it.fields[5],
            Bound::From,
            (codes[1] + beside).ceil(),
        )]);
        let reach_m = sensor.offset_m + sensor.gain * sensor.stroke_m;
        let least_m = (reach_m / high * 1e4).ceil() * 1e-4;
        offers.push(vec![Offer::new(f, it.fields[0], Bound::From, least_m)]);
        let stroke_m = (sensor.stroke_of(high) * 1e4).floor() * 1e-4;
        if stroke_m > 0.0 {
            offers.push(vec![Offer::new(f, it.fields[3], Bound::UpTo, stroke_m)]);
        }
        let offset_m = high * sensor.electrical_m - sensor.gain * sensor.stroke_m;
        let offset_m = (offset_m * 1e4).floor() * 1e-4;
        if offset_m >= low * sensor.electrical_m {
            offers.push(vec![Offer::new(f, it.fields[1], Bound::UpTo, offset_m)]);
        }
    }
    let [from, to] = [low, high].map(|share| brief(sensor.stroke_of(share) * 1e3));
    Some(Broken {
        figures: sensor.format(codes, "of 65536 codes"),
        offers,
        words: format!(
            "allowed are codes from {} to {}, which with up to {} codes beside them are strokes from \
             {from} to {to} mm",
            pretty(least),
            pretty(most),
            brief(beside)
        ),
    })
}

/// The strokes that a joint board measures at both stops are within its allowed travel.
pub(super) fn calibration(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let sensor = Calibrated::of(f, it)?;
    let measured = sensor.measured(f.si(it.fields[4])?, f.si(it.fields[5])?);
    let (least, most) = (f.si(it.fields[6])?, f.si(it.fields[7])?);
    let reading = [8, 9, 10].map(|i| it.fields[i]);
    let full_scale_mm = f.si(it.fields[4])?;
    let off_mm = full_scale_mm * reading_error(f, reading)?;
    if measured[0] - off_mm >= least && measured[1] + off_mm <= most {
        return None;
    }
    let range = format!("{} to {} mm", pretty(least), pretty(most));
    let mut offers = vec![sensor.calibrated(f, it)];
    let room = f64::min(measured[0] - least, most - measured[1]) / full_scale_mm;
    offers.extend(less_noise(f, reading, room));
    // A board that measures what is may still be told a travel that is too short.
    let [low, high] = [measured[0] - off_mm, measured[1] + off_mm];
    let measures = [measured[0], measured[1] - sensor.stroke_m * 1e3].map(f64::abs);
    if measures.iter().all(|error_mm| *error_mm < off_mm) {
        if low < least {
            let most_mm = (low * 10.0).floor() * 0.1;
            offers.push(vec![Offer::new(f, it.fields[6], Bound::UpTo, most_mm)]);
        }
        if high > most {
            let least_mm = (high * 10.0).ceil() * 0.1;
            offers.push(vec![Offer::new(f, it.fields[7], Bound::From, least_mm)]);
        }
    }
    // Rounded to usual numbers; a stop that is measured too low gives no limit.
    let stroke_m = sensor.stroke_at(most - off_mm, full_scale_mm, f.si(it.fields[5])?);
    let stroke_m = (stroke_m * 1e4).floor() * 1e-4;
    if stroke_m > 0.0 && stroke_m < sensor.stroke_m {
        offers.push(vec![Offer::new(f, it.fields[3], Bound::UpTo, stroke_m)]);
    }
    Some(Broken {
        figures: sensor.format(measured, "mm"),
        offers,
        words: format!(
            "a board takes strokes of {range}, and measures up to {} mm beside them",
            brief(off_mm)
        ),
    })
}

/// A joint that is drawn in, and one extended for the gait, measure close to their true strokes.
pub(super) fn measured(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let sensor = Calibrated::of(f, it)?;
    let measured = sensor.measured(f.si(it.fields[4])?, f.si(it.fields[5])?);
    let out_mm = f.si(it.fields[6])? * 1e3;
    let tolerance_mm = f.si(it.fields[7])? * 1e3;
    let share = out_mm * 1e-3 / sensor.stroke_m;
    let out = measured[0] + share * (measured[1] - measured[0]);
    if measured[0].abs() <= tolerance_mm && (out - out_mm).abs() <= tolerance_mm {
        return None;
    }
    Some(Broken {
        figures: sensor.format(measured, "mm"),
        offers: vec![sensor.calibrated(f, it)],
        words: format!(
            "allowed are up to {} mm beside 0 with the rod in and beside {} mm in the pose, \
             `homing.tolerance`",
            pretty(tolerance_mm),
            pretty(out_mm)
        ),
    })
}

/// A joint rests in a band of some steps of its converter.
pub(super) fn converter(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let [bits, electrical, band] = [0, 1, 2].map(|i| f.si(it.fields[i]));
    let (electrical_m, band_m) = (electrical?, band? * 1e-3);
    let least_m = STEPS_AT_REST * electrical_m / bits?.exp2();
    if band_m >= least_m {
        return None;
    }
    let bits = (STEPS_AT_REST * electrical_m / band_m).log2().ceil();
    let least_band_mm = (least_m * 1e6).ceil() * 1e-3;
    offered(
        format!("{STEPS_AT_REST} steps are {} mm", brief(least_m * 1e3)),
        vec![
            Offer::new(f, it.fields[0], Bound::From, bits),
            Offer::new(f, it.fields[2], Bound::From, least_band_mm),
        ],
    )
}
