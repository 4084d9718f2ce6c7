//! The predictive law: paper's idea, positions made of forces made of air.
//!
//! ```text
//! stroke, speed, pressures ── dead time ahead ──► x, v, pA, pB there
//! e = reference − x            v* = v_r + min(slope e, √(2 brake (|e| − …)), top)
//! a* = dv*/dt + damping (v* − v)
//! F* = m a* + friction(v*) − load + what it takes to unstick
//! pA*, pB* : their force is F*, about the mean pressure
//! opening of each valve: the pressure it lacks / the rate at which it changes
//! ```
//!
//! * **Dead time.** A pulse begun now acts a tick, t_on and the wave's way later.
//!   Everything is decided for that moment: the motion is extrapolated, and air
//!   that pulses under way will still bring is counted in.
//! * **Braking** follows a parabola in e, so that one law serves 1 and 400 mm; the
//!   deceleration is what the force left beside the load allows.
//! * **Friction** is fed forward in the direction of v*; a piston that stands
//!   outside the band is pushed with a growing force until it slips.
//! * **Rest.** Inside the band and slow, all valves shut, and stay shut until the
//!   error has left three bands. A piston is also let to rest when friction alone
//!   will stop it in the band. What does not come to rest near its target for
//!   long may do so in a wider band, up to three times: no limit cycle lasts.
//! * **Announced moves.** With a move announced, the force is brought to the edge
//!   of slipping in its direction: the counter chamber vents and the drive
//!   chamber fills ahead of time, and the piston stands.
//! * **Pressure swap.** A chamber vents no faster than its valve lets it. In an
//!   announced move, and in one from an end stop, the other chamber makes up for what
//!   it still has too much, and gives way as it falls: the force is there as soon as
//!   either chamber can make it.

use super::gas::{ChamberRates, Pressures, Wanted};
use super::learn::Learner;
use super::model::AxisModel;
use super::motion::{Inertia, Motion};
use super::valves::ValveTrack;
use super::{scaled, square_root, within};
use crate::joint::JointInput;
use crate::pwm::OnTimes;
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

/// Slower than this, raw mm/s, the piston stands (3 mm/s).
const STILL: i32 = 3 << 16;
/// Fast enough for the sign of friction to be that of the motion (10 mm/s).
const SLIDES: i32 = 10 << 16;
/// Slower than this a piston in the band is caught by shutting the valves (6 mm/s).
const CATCH: i32 = 6 << 16;
/// A reference slower than this is a step (1 mm/s).
const REFERENCE_RESTS: i32 = 1 << 16;
/// Ticks in the band before rest.
const REST_TICKS: u16 = 30;
/// Ticks near the target without coming to rest after which the band widens …
const PATIENCE: u16 = 500;
/// … by one band in so many ticks, up to three bands in all.
const PATIENCE_STEP: i32 = 1 << PATIENCE_SHIFT;
const PATIENCE_SHIFT: u32 = 9;
/// A chamber lags whose pressure is so much above its target (10 kPa in 1/256 Pa).
const LAG: i32 = 10_000 << 8;
/// Ticks outside three bands before the end of rest.
const RELEASE_TICKS: u16 = 4;

/// What the law gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drive {
    /// On-times of the next tick, µs.
    pub on: OnTimes,
    /// At rest at the reference.
    pub settled: bool,
    /// The force asked for is beyond what the supply can give.
    pub limited: bool,
    /// Force asked for, mN.
    pub force: i32,
}

/// State of the law.
#[derive(Clone, Debug, Hash)]
pub struct Predictive {
    model: AxisModel,
    inertia: Inertia,
    valves: [ValveTrack; 4],
    /// Open times of the tick that begins now.
    opening: [i32; 4],
    pressures: Pressures,
    motion: Motion,
    learner: Learner,
    /// Extra force on a piston that sticks, mN × 2^8.
    push: i32,
    target: i32,
    held: u16,
    released: u16,
    near: u16,
    /// Where the piston stood when the next move was announced.
    awaits: Option<i32>,
    /// The drive chamber makes up for what the counter chamber still has too much,
    /// in a move that extends (true) or retracts.
    makes_up: Option<bool>,
    settled: bool,
    primed: bool,
}

impl Predictive {
    /// At rest, both chambers at the atmosphere.
    #[must_use]
    pub fn new(model: AxisModel) -> Self {
        Self {
            inertia: Inertia::new(&model, model.mass),
            valves: [ValveTrack::new(); 4],
            opening: [0; 4],
            pressures: Pressures {
                a: model.ambient,
                b: model.ambient,
            },
            motion: Motion::default(),
            learner: Learner::new(),
            push: 0,
            target: 0,
            held: 0,
            released: 0,
            near: 0,
            awaits: None,
            makes_up: None,
            settled: false,
            primed: false,
            model,
        }
    }

    /// The coefficients in use.
    #[must_use]
    pub const fn model(&self) -> &AxisModel {
        &self.model
    }

    /// Estimated motion and load.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Estimated pressures.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        self.pressures
    }

    /// Mass in use, kg × 2^16: as told, or learnt.
    #[must_use]
    pub const fn mass(&self) -> i32 {
        self.inertia.mass
    }

    /// At rest at its reference.
    #[must_use]
    pub const fn is_settled(&self) -> bool {
        self.settled
    }

    /// Follows valves, chambers and piston through a tick in which `sent` were the
    /// on-times last given out, whoever chose them. To be called once per
    /// tick, before [`Predictive::drive`] if that is called at all.
    pub fn follow(&mut self, measured: PositionMm, sent: &OnTimes) -> VelocityMmS {
        let model = &self.model;
        if !self.primed {
            self.primed = true;
            self.motion.stroke = measured.raw();
            self.target = measured.raw();
        }
        let [fill_a, vent_a, fill_b, vent_b] = self.opening;
        let (stroke, speed) = (self.motion.stroke, self.motion.speed);
        let a = model.rates_a(self.pressures.a, stroke, speed, wanted(fill_a, vent_a));
        let b = model.rates_b(self.pressures.b, stroke, speed, wanted(fill_b, vent_b));
        let tick = model.times.tick;
        // Never below half the atmosphere: a vacuum needs a motion of its own.
        let least = model.ambient.wrapping_shr(1);
        self.pressures = Pressures {
            a: self
                .pressures
                .a
                .saturating_add(a.change(fill_a, vent_a, tick))
                .max(least),
            b: self
                .pressures
                .b
                .saturating_add(b.change(fill_b, vent_b, tick))
                .max(least),
        };
        for ((opening, valve), &on) in self.opening.iter_mut().zip(&mut self.valves).zip(sent) {
            *opening = valve.advance(i32::from(on), &model.times);
        }
        let force = model.pressure_force(self.pressures);
        self.motion
            .update(model, &self.inertia, force, measured.raw());
        self.learner.sample(model, &self.motion, force);
        VelocityMmS::from_raw(self.motion.speed)
    }

    /// The force asked for as a share of what the supply can give.
    #[must_use]
    pub fn duty(&self, drive: &Drive) -> Duty {
        let most = if drive.force > 0 {
            self.model.force_out
        } else {
            self.model.force_in
        };
        let share = i64::from(drive.force)
            .wrapping_shl(30)
            .checked_div(i64::from(most))
            .unwrap_or(0);
        Duty::from_raw_wide(share)
    }

    /// Forgets the rest state: the joint does not track.
    pub fn release(&mut self) {
        self.settled = false;
        self.held = 0;
        self.push = 0;
        self.target = self.motion.stroke;
    }

    /// On-times for the next tick.
    pub fn drive(&mut self, input: &JointInput) -> Drive {
        let reference = input.reference.raw();
        let reference_speed = input.reference_velocity.raw();
        self.learn();
        let quiet = self.rest(reference, reference_speed, input.measured.raw());
        let ahead = self.ahead();
        let stands = quiet || self.motion.speed.wrapping_abs() < STILL;
        let awaited = match input.announced {
            Some(announced) if stands => self.preload(announced.reference.raw()),
            _ => None,
        };
        if input.announced.is_none() {
            self.awaits = None;
        }
        if awaited.is_some() || (stands && self.motion.at_stop(&self.model)) {
            let to = match input.announced {
                Some(announced) if awaited.is_some() => announced.reference.raw(),
                _ => reference,
            };
            self.makes_up = Some(to > self.motion.stroke);
        }
        let force = match awaited {
            Some(force) => force,
            None if quiet => return self.shut(),
            None => self.wanted_force(reference, reference_speed, &ahead),
        };
        self.pulses(force, &ahead)
    }

    /// Takes over a mass that has been learnt, while nothing moves.
    fn learn(&mut self) {
        if self.motion.speed.wrapping_abs() < STILL
            && let Some(mass) = self.learner.take()
        {
            self.inertia = Inertia::new(&self.model, mass);
        }
    }

    /// Rest detection; whether the valves are to stay shut.
    fn rest(&mut self, reference: i32, reference_speed: i32, measured: i32) -> bool {
        let narrow = self.model.band;
        let error = reference
            .saturating_sub(self.motion.stroke)
            .saturating_abs();
        let steps = reference_speed.wrapping_abs() <= REFERENCE_RESTS;
        if reference.saturating_sub(self.target).saturating_abs() > narrow {
            self.target = reference;
            self.push = 0;
            self.near = 0;
        }
        let near = steps && !self.settled && error < narrow.saturating_mul(24);
        if near {
            self.near = self.near.saturating_add(1).min(PATIENCE.saturating_mul(4));
        } else if !self.settled {
            self.near = self.near.saturating_sub(1);
        }
        // Patience: what has not come to rest for long may do so in a wider band.
        let beyond = self.beyond();
        let wider = scaled(narrow, beyond.min(2 * PATIENCE_STEP), PATIENCE_SHIFT);
        let band = narrow.saturating_add(wider);
        let catch =
            CATCH.saturating_add(scaled(CATCH, beyond.min(2 * PATIENCE_STEP), PATIENCE_SHIFT));

        let slow = error < band && self.motion.speed.wrapping_abs() < catch;
        let quiet = steps && (slow || self.stops_within(reference, band));
        self.held = if quiet {
            self.held.saturating_add(1)
        } else {
            0
        };
        if self.held > REST_TICKS {
            self.settled = true;
        }
        let release = narrow.saturating_mul(2).saturating_add(band);
        let outside = reference.saturating_sub(measured).saturating_abs() > release;
        if self.settled && (outside || !steps) {
            self.released = self.released.saturating_add(1);
            if self.released >= RELEASE_TICKS || !steps {
                self.settled = false;
                self.held = 0;
                self.released = 0;
            }
        } else {
            self.released = 0;
        }
        self.settled || quiet
    }

    /// Ticks near the target beyond what patience allows.
    fn beyond(&self) -> i32 {
        i32::from(self.near.saturating_sub(PATIENCE))
    }

    /// Whether friction alone stops the piston within the band, if the valves shut:
    /// the way is the kinetic energy over what friction has left beside the
    /// forces that act.
    fn stops_within(&self, reference: i32, band: i32) -> bool {
        let m = &self.motion;
        let speed = m.speed.wrapping_shr(8);
        let error = reference.saturating_sub(m.stroke);
        if error.saturating_abs() > band.saturating_mul(12) {
            return false;
        }
        let net = self
            .model
            .pressure_force(self.pressures)
            .saturating_add(m.load);
        let along = if speed < 0 { net.saturating_neg() } else { net };
        let stopping = self.model.coulomb.saturating_sub(along);
        if stopping < self.model.coulomb >> 2 {
            return false;
        }
        // kg × mm²/s² = µJ = mN × mm, all × 2^16.
        let energy = i64::from(self.inertia.mass)
            .wrapping_mul(i64::from(speed).wrapping_mul(i64::from(speed)))
            .wrapping_shr(17);
        let ahead = if speed < 0 {
            error.saturating_neg()
        } else {
            error
        };
        let work = |way: i32| i64::from(stopping).wrapping_mul(i64::from(way));
        energy > work(ahead.saturating_sub(band)) && energy < work(ahead.saturating_add(band))
    }

    /// Everything shut as soon as the pulses under way allow.
    fn shut(&self) -> Drive {
        let mut on = [0; 4];
        for (on, valve) in on.iter_mut().zip(&self.valves) {
            *on = microseconds(valve.on_time(0, true, &self.model.times));
        }
        Drive {
            on,
            settled: self.settled,
            limited: false,
            force: 0,
        }
    }

    /// State at the end of the dead time.
    fn ahead(&self) -> Ahead {
        let model = &self.model;
        let times = &model.times;
        let committed = |valve: usize| {
            let now = self.opening.get(valve).copied().unwrap_or(0);
            let later = self.valves.get(valve).map_or(0, |v| v.committed(times));
            now.saturating_add(later)
        };
        let open = [committed(0), committed(1), committed(2), committed(3)];
        let m = &self.motion;
        let gained = scaled(m.acceleration, model.horizon, 16);
        let mean = m.speed.saturating_add(gained.wrapping_shr(1));
        let stroke = m.stroke.saturating_add(scaled(mean, model.horizon, 32));
        // A flow that nothing has been committed to waits until it is known to be
        // wanted.
        let [fill_a, vent_a, fill_b, vent_b] = open;
        let a = model.rates_a(self.pressures.a, stroke, mean, wanted(fill_a, vent_a));
        let b = model.rates_b(self.pressures.b, stroke, mean, wanted(fill_b, vent_b));
        let span = model.horizon_us;
        let pressures = Pressures {
            a: self
                .pressures
                .a
                .saturating_add(a.change(fill_a, vent_a, span)),
            b: self
                .pressures
                .b
                .saturating_add(b.change(fill_b, vent_b, span)),
        };
        let drive = model.pressure_force(pressures).saturating_add(m.load);
        let speed = if m.stuck && drive.saturating_abs() < model.breakaway {
            0
        } else {
            // Mean of the accelerations now and then.
            let then = self.inertia.acceleration(drive.saturating_sub(m.friction));
            let mean = m.acceleration.saturating_add(then).wrapping_shr(1);
            m.speed.saturating_add(scaled(mean, model.horizon, 16))
        };
        Ahead {
            stroke,
            speed,
            pressures,
            a,
            b,
        }
    }

    /// F*: the force that is wanted at the end of the dead time.
    fn wanted_force(&mut self, reference: i32, reference_speed: i32, ahead: &Ahead) -> i32 {
        let (model, inertia) = (&self.model, &self.inertia);
        let load = self.motion.load;
        let error = reference
            .saturating_add(scaled(reference_speed, model.horizon, 32))
            .saturating_sub(ahead.stroke);
        // The force that can brake, beside the load: seven tenths of it are used.
        let left = if error > 0 {
            model.force_in.saturating_sub(load)
        } else {
            model.force_out.saturating_add(load)
        };
        let possible = inertia.acceleration(scaled(left, 45_875, 16));
        let brake = inertia.brake.min(possible).max(200);
        let (speed, slope) = speed_law(error, brake, inertia, model.top_speed);
        let wanted = reference_speed.saturating_add(speed);
        // 1/s × 2^8 times raw mm/s: mm/s² × 2^24.
        let pull = scaled(slope, reference_speed.saturating_sub(ahead.speed), 24);
        let damp = scaled(inertia.damping, wanted.saturating_sub(ahead.speed), 24);
        let limit = inertia.brake.saturating_mul(5) >> 1;
        let acceleration = within(pull.saturating_add(damp), limit);

        let still = self.motion.speed.wrapping_abs() < STILL;
        self.push = if !still {
            self.push.saturating_sub(self.push.wrapping_shr(3))
        } else if reference_speed.wrapping_abs() <= REFERENCE_RESTS {
            let missing = reference.saturating_sub(self.motion.stroke);
            let step = if missing > 0 {
                model.stick_step
            } else {
                model.stick_step.wrapping_neg()
            };
            let most = model.force_out.min(1 << 22).wrapping_shl(8);
            within(self.push.saturating_add(step), most)
        } else {
            self.push
        };
        let grip = if still {
            model.breakaway
        } else {
            model.coulomb
        };
        // What is fed forward for friction that is less than told makes a relay:
        // where the piston does not come to rest, it fades.
        let left = (2 * PATIENCE_STEP).saturating_sub(self.beyond()).max(0);
        let grip = scaled(grip, left, PATIENCE_SHIFT.wrapping_add(1));
        let along = if ahead.speed.wrapping_abs() > SLIDES {
            ahead.speed
        } else {
            wanted
        };
        // Full grip from 10 mm/s: × grip / (10 × 2^16).
        let friction = scaled(within(along, SLIDES), grip / 10, 16);
        scaled(inertia.mass, acceleration, 16)
            .saturating_add(friction)
            .saturating_add(scaled(wanted, model.viscous, 24))
            .saturating_add(self.push.wrapping_shr(8))
            .saturating_sub(load)
    }

    /// The force with which an announced move to `next` is awaited; `None` if
    /// the piston has begun to move, or the move is none.
    fn preload(&mut self, next: i32) -> Option<i32> {
        let stroke = self.motion.stroke;
        let place = *self.awaits.get_or_insert(stroke);
        let distance = next.saturating_sub(place);
        let gone = stroke.saturating_sub(place).saturating_abs();
        let band = self.model.band;
        if distance.saturating_abs() <= band || gone > band.saturating_mul(2) {
            return None;
        }
        let edge = self.model.coulomb.wrapping_shr(1);
        let edge = if distance > 0 {
            edge
        } else {
            edge.wrapping_neg()
        };
        Some(edge.saturating_sub(self.motion.load))
    }

    /// Chamber pressures for a force, and the pulses that make them.
    fn pulses(&mut self, force: i32, ahead: &Ahead) -> Drive {
        let (mut target, limited) = targets(&self.model, force);
        if let Some(extends) = self.makes_up {
            match made_up(&self.model, force, target, ahead.pressures, extends) {
                Some(other) => target = other,
                None => self.makes_up = None,
            }
        }
        let model = &self.model;
        let mut on = [0; 4];
        let (mut a, mut b) = (ahead.a, ahead.b);
        let missing = |change: i32, rates: &ChamberRates| Wanted {
            fill: change > 0 && rates.fill == 0,
            vent: change < 0 && rates.vent == 0,
        };
        let lacks = missing(target.a.saturating_sub(ahead.pressures.a), &a);
        if lacks.fill || lacks.vent {
            let more = model.rates_a(self.pressures.a, ahead.stroke, 0, lacks);
            (a.fill, a.vent) = (
                a.fill.wrapping_add(more.fill),
                a.vent.wrapping_add(more.vent),
            );
        }
        let lacks = missing(target.b.saturating_sub(ahead.pressures.b), &b);
        if lacks.fill || lacks.vent {
            let more = model.rates_b(self.pressures.b, ahead.stroke, 0, lacks);
            (b.fill, b.vent) = (
                b.fill.wrapping_add(more.fill),
                b.vent.wrapping_add(more.vent),
            );
        }
        let chambers = [
            (target.a.saturating_sub(ahead.pressures.a), &a),
            (target.b.saturating_sub(ahead.pressures.b), &b),
        ];
        for ((change, rates), (pair, valves)) in chambers
            .into_iter()
            .zip(on.chunks_exact_mut(2).zip(self.valves.chunks_exact(2)))
        {
            let ([fill_on, vent_on], [fill, vent]) = (pair, valves) else {
                continue;
            };
            let (fill_need, vent_need) = if change > 0 {
                (model.opening(change, rates.fill), 0)
            } else {
                (0, model.opening(change.saturating_neg(), rates.vent))
            };
            *fill_on = microseconds(fill.on_time(fill_need, vent.coil(), &model.times));
            *vent_on = microseconds(vent.on_time(vent_need, fill.coil(), &model.times));
        }
        Drive {
            on,
            settled: false,
            limited,
            force,
        }
    }
}

/// Motion and pressures at the end of the dead time.
struct Ahead {
    stroke: i32,
    speed: i32,
    pressures: Pressures,
    a: ChamberRates,
    b: ChamberRates,
}

#[inline]
const fn wanted(fill: i32, vent: i32) -> Wanted {
    Wanted {
        fill: fill > 0,
        vent: vent > 0,
    }
}

/// An on-time, 0…tick (at most 2000).
#[inline]
const fn microseconds(on: i32) -> u16 {
    on as u16
}

/// Speed towards the target, raw mm/s, and its slope over the error, 1/s × 2^8.
#[inline]
fn speed_law(error: i32, brake: i32, inertia: &Inertia, top: i32) -> (i32, i32) {
    // Half of the error up to which the law is a straight line: brake / (2 slope²),
    // mm/s² × s² × 2^32 to raw mm.
    let half = scaled(brake, inertia.linear, 16);
    let size = error.saturating_abs();
    if size <= half.saturating_mul(2) {
        return (scaled(inertia.slope, error, 8), inertia.slope);
    }
    // (32 v)² = 2 brake e × 2^10, e raw: × 2^11 / 2^16.
    let square = i64::from(brake)
        .wrapping_mul(i64::from(size.saturating_sub(half)))
        .wrapping_shr(5);
    let square = u32::try_from(square).unwrap_or(u32::MAX);
    // At most 65 536 / 32 mm/s: fits raw mm/s.
    let root = square_root(square).max(1) as i32;
    let speed = root.wrapping_shl(11);
    if speed >= top {
        return (if error < 0 { top.wrapping_neg() } else { top }, 0);
    }
    let slope = brake.wrapping_shl(13).checked_div(root).unwrap_or(0);
    (
        if error < 0 {
            speed.wrapping_neg()
        } else {
            speed
        },
        slope,
    )
}

/// A pressure that valves can make.
#[inline]
fn possible(model: &AxisModel, pressure: i32) -> i32 {
    pressure.max(model.low).min(model.high)
}

/// Pressure of B that makes `force` with `a` in A: (pA AA − rod − F) / AB.
#[inline]
fn b_of(model: &AxisModel, force: i32, a: i32) -> i32 {
    scaled(a, model.area_ratio, 24).saturating_sub(scaled(
        force.saturating_add(model.force_rod),
        model.pressure_b,
        12,
    ))
}

/// Pressure of A that makes `force` with `b` in B.
#[inline]
fn a_of(model: &AxisModel, force: i32, b: i32) -> i32 {
    let sum = force
        .saturating_add(model.force_rod)
        .saturating_add(scaled(b, model.force_b, 32));
    scaled(sum, model.pressure_a, 12)
}

/// Pressures whose force is `force`, as near as the supply allows, about the mean.
#[inline]
fn targets(model: &AxisModel, force: i32) -> (Pressures, bool) {
    let a = possible(
        model,
        model
            .mean
            .saturating_add(scaled(force, model.half_pressure_a, 12)),
    );
    let b = b_of(model, force, a);
    let bounded = possible(model, b);
    if bounded == b {
        return (Pressures { a, b }, false);
    }
    let wished = a_of(model, force, bounded);
    let a = possible(model, wished);
    (Pressures { a, b: bounded }, a != wished)
}

/// Targets while the counter chamber still has too much: the drive chamber makes the
/// force with what that one has. `None` if it does not lag.
#[inline]
fn made_up(
    model: &AxisModel,
    force: i32,
    target: Pressures,
    now: Pressures,
    extends: bool,
) -> Option<Pressures> {
    if extends {
        let a = possible(model, a_of(model, force, now.b)).max(target.a);
        (now.b.saturating_sub(target.b) > LAG).then_some(Pressures { a, ..target })
    } else {
        let b = possible(model, b_of(model, force, now.a)).max(target.b);
        (now.a.saturating_sub(target.a) > LAG).then_some(Pressures { b, ..target })
    }
}
