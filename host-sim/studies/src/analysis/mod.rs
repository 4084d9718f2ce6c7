//! Compares a recording with the paper's targets (MODEL.md §11) and with the
//! project's own (safe states, rest).

mod contact;
mod delay;
mod indices;
mod moves;
mod reference;
mod rest;
mod safe_state;
mod sinusoid;
mod target;
#[cfg(test)]
pub(crate) mod testing;
mod three_step;
mod travel;

use std::collections::VecDeque;

pub use contact::Contact;
use contact::ContactMeter;
use delay::{DelayMeter, ShiftMeter};
pub use delay::{Fit, StartDelay};
pub use indices::LegIndices;
pub use reference::{ReferenceModel, ReferencePoint};
use rest::StandMeter;
use safe_state::SafeStateMeter;
pub(crate) use safe_state::commanded_open;
use sinusoid::SinusoidMeter;
pub use target::{Judgement, Target, band_text};
pub(crate) use target::{asked_text, measured_text};
use three_step::ThreeStepMeter;
use travel::TravelMeter;

use wheeleg_config::{EventAction, LegChoice, Motion, RobotConfig, Scenario, TargetSet};
use wheeleg_telemetry::{
    BodySample, Event, FootSample, JointSample, MasterSample, Recording, Row, SampleRef, Sink,
    SupplySample, Taken, WheelSample,
};

/// Results of the analysis.
#[derive(Debug, Clone)]
pub struct Analysis {
    /// Targets with values and verdicts.
    pub targets: Vec<Target>,
    /// The reference model, for square-wave scenarios.
    pub reference: Option<ReferenceModel>,
    /// Time of the motion's start on the recording's clock, s.
    pub start_s: f64,
    /// The stepping or moving leg.
    pub leg: Option<LegChoice>,
    /// Delay from commanded step to motion, per move.
    pub start_delays: Vec<StartDelay>,
    /// Strokes against those of the reference model; only if no event of the scenario disturbs the motion.
    pub fit: Option<Fit>,
    /// Lifts and touchdowns of the stepping foot.
    pub contacts: Vec<Contact>,
}

impl Analysis {
    /// Whether every required target is met.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.targets.iter().all(|t| t.pass || !t.required)
    }
}

/// The targets of a scenario, while samples come in.
enum Meter {
    ThreeStep(Box<ThreeStepMeter>),
    Stand(Box<StandMeter>),
    SafeState(Box<SafeStateMeter>),
    Sinusoid(Box<SinusoidMeter>),
    FootSide(u8),
    None,
}

impl Meter {
    fn new(scenario: &Scenario, robot: &RobotConfig, start_s: f64) -> Self {
        let safe_state = |is: fn(&EventAction) -> bool, estop| {
            let meter = SafeStateMeter::new(event_time(scenario, is), estop);
            Self::SafeState(Box::new(meter))
        };
        match scenario.targets {
            TargetSet::ThreeStep => {
                let sample_s = robot.reference.sample_period_s;
                Self::ThreeStep(Box::new(ThreeStepMeter::new(robot.gait, sample_s, start_s)))
            }
            TargetSet::Stand => Self::Stand(Box::default()),
            TargetSet::MasterLost => safe_state(|a| matches!(a, EventAction::KillMaster), false),
            TargetSet::EStop => safe_state(|a| matches!(a, EventAction::EStop), true),
            TargetSet::Sinusoid => Self::Sinusoid(Box::default()),
            TargetSet::FootSide { bit } => Self::FootSide(bit),
            TargetSet::None => Self::None,
        }
    }
}

/// Analyses a run while it lasts, in bounded memory: every sample counts, none is kept.
pub struct Analyser<'a> {
    scenario: &'a Scenario,
    robot: &'a RobotConfig,
    /// The moving leg.
    moving: Option<LegChoice>,
    /// Start of the motion, s; the start of the record until it has begun.
    start_s: Option<f64>,
    /// Last samples of the joints, for values that count from the start of the motion: the master reports it
    /// afterwards.
    recent: VecDeque<(usize, Row<JointSample>)>,
    meter: Meter,
    travel: Option<TravelMeter>,
    delays: Option<DelayMeter>,
    shift: Option<ShiftMeter>,
    contacts: Option<ContactMeter>,
}

/// How far back the analyser keeps samples, s, in addition to three bus cycles.
const RECENT_S: f64 = 0.05;

impl<'a> Analyser<'a> {
    /// Evaluates everything that the scenario asks for.
    #[must_use]
    pub fn new(scenario: &'a Scenario, robot: &'a RobotConfig) -> Self {
        let moving = match scenario.motion {
            Motion::Stand | Motion::Walk(_) => None,
            Motion::SquareWave { leg } | Motion::Sinusoid { leg, .. } => Some(leg),
        };
        let steps = matches!(scenario.motion, Motion::SquareWave { .. });
        let mut analyser = Self {
            scenario,
            robot,
            moving,
            start_s: None,
            recent: VecDeque::new(),
            meter: Meter::None,
            travel: (!scenario.bars.is_empty()).then(TravelMeter::default),
            delays: None,
            shift: None,
            contacts: steps.then(ContactMeter::default),
        };
        analyser.meter = Meter::new(scenario, robot, 0.0);
        analyser.count_from(0.0);
        analyser
    }

    /// Resets all counts that start with the motion.
    fn count_from(&mut self, start_s: f64) {
        if let Meter::ThreeStep(_) = self.meter {
            self.meter = Meter::new(self.scenario, self.robot, start_s);
        }
        if self.contacts.is_some() {
            self.delays = Some(DelayMeter::new(self.robot.gait, start_s));
            // The model does not know the scenario's events.
            let undisturbed = self.scenario.events.is_empty();
            self.shift = undisturbed.then(|| ShiftMeter::new(start_s));
        }
    }

    /// The motion began when the master first was in a step.
    fn master(&mut self, t_s: f64, master: &MasterSample) {
        if let Some(travel) = &mut self.travel {
            travel.master(t_s, master);
        }
        if self.start_s.is_some() || master.step == 0 {
            return;
        }
        self.start_s = Some(t_s);
        self.count_from(t_s);
        for (joint, row) in std::mem::take(&mut self.recent) {
            self.count_joint(joint, &row);
        }
    }

    fn joint(&mut self, joint: usize, row: &Row<JointSample>) {
        match &mut self.meter {
            Meter::Stand(meter) => meter.joint(joint, row),
            Meter::SafeState(meter) => meter.joint(joint, row),
            Meter::Sinusoid(meter) => {
                let first = first_joint(self.moving);
                if joint == first + 1 {
                    meter.b5(&row.v);
                } else if joint == first + 2 {
                    meter.b6(&row.v);
                }
            }
            Meter::ThreeStep(_) | Meter::FootSide(_) | Meter::None => {}
        }
        self.count_joint(joint, row);
    }

    /// Keeps a sample until it is known whether the motion had begun.
    fn remember(&mut self, joint: usize, row: Row<JointSample>) {
        if self.start_s.is_some() {
            return;
        }
        let reach_s = RECENT_S + 3.0 * self.robot.bus.cycle_s;
        let from_s = row.t_s() - reach_s;
        while self.recent.front().is_some_and(|(_, r)| r.t_s() < from_s) {
            self.recent.pop_front();
        }
        self.recent.push_back((joint, row));
    }

    /// Counts a sample that belongs to the motion.
    fn count_joint(&mut self, joint: usize, row: &Row<JointSample>) {
        let first = first_joint(self.moving);
        let (is_b5, is_b6) = (joint == first + 1, joint == first + 2);
        if let Meter::ThreeStep(meter) = &mut self.meter {
            meter.joint(joint, row);
            if is_b5 {
                meter.b5(row);
            } else if is_b6 {
                meter.b6(row);
            }
        }
        if is_b5 || is_b6 {
            if let Some(delays) = &mut self.delays {
                delays.joint(is_b5, row);
            }
            if let Some(shift) = &mut self.shift {
                shift.joint(is_b5, row);
            }
        }
    }

    fn body(&mut self, t_s: f64, body: &BodySample) {
        if let Some(travel) = &mut self.travel {
            travel.body(t_s, body);
        }
    }

    fn wheel(&mut self, wheel: usize, row: &Row<WheelSample>) {
        if let Meter::SafeState(meter) = &mut self.meter {
            meter.wheel(wheel, row);
        }
        if let Some(travel) = &mut self.travel {
            travel.wheel(wheel, row.t_s(), &row.v);
        }
    }

    fn event(&mut self, t_s: f64, event: &Event) {
        if let Some(travel) = &mut self.travel {
            travel.event(t_s, event);
        }
    }

    fn foot(&mut self, foot: usize, t_ns: u64, sample: &FootSample) {
        if let Some(travel) = &mut self.travel {
            travel.foot(foot, sample);
        }
        let moving = usize::from(self.moving == Some(LegChoice::Right));
        if let Some(contacts) = self.contacts.as_mut().filter(|_| foot == moving) {
            contacts.foot(t_ns, sample);
        }
    }

    fn supply(&mut self, row: &Row<SupplySample>) {
        if let Meter::SafeState(meter) = &mut self.meter {
            meter.supply(row);
        }
        if let Some(travel) = &mut self.travel {
            travel.supply(row.t_s(), &row.v);
        }
    }

    /// The results.
    #[must_use]
    pub fn finish(self) -> Analysis {
        let reference = self
            .contacts
            .is_some()
            .then(|| ReferenceModel::new(self.robot.reference, self.robot.gait));
        let fit = match (self.shift, &reference) {
            (Some(shift), Some(model)) => shift.fit(model),
            _ => None,
        };
        let mut analysis = Analysis {
            targets: Vec::new(),
            start_s: self.start_s.unwrap_or(0.0),
            leg: self.moving,
            start_delays: self.delays.map_or(Vec::new(), DelayMeter::into_delays),
            fit,
            contacts: self
                .contacts
                .map_or(Vec::new(), ContactMeter::into_contacts),
            reference,
        };
        analysis.targets = match self.meter {
            Meter::ThreeStep(meter) => meter.targets(self.robot, &analysis),
            Meter::Stand(meter) => meter.targets(),
            Meter::SafeState(meter) => meter.targets(),
            Meter::Sinusoid(meter) => meter.targets(self.robot),
            Meter::FootSide(bit) => contact::side_targets(&analysis.contacts, bit),
            Meter::None => Vec::new(),
        };
        if let Some(travel) = self.travel {
            analysis
                .targets
                .extend(travel.targets(self.robot, &self.scenario.bars));
        }
        analysis
    }
}

impl Sink for Analyser<'_> {
    fn take(&mut self, taken: &Taken<'_>) {
        let Taken { number, t_ns, .. } = *taken;
        match taken.sample {
            SampleRef::Joint(v) => {
                let row = row(t_ns, v);
                self.joint(number, &row);
                self.remember(number, row);
            }
            SampleRef::Foot(v) => self.foot(number, t_ns, v),
            SampleRef::Master(v) => self.master(t_ns as f64 * 1e-9, v),
            SampleRef::Wheel(v) => self.wheel(number, &row(t_ns, v)),
            SampleRef::Body(v) => self.body(t_ns as f64 * 1e-9, v),
            SampleRef::Supply(v) => self.supply(&row(t_ns, v)),
            _ => {}
        }
    }

    fn event(&mut self, t_ns: u64, event: &Event) {
        Analyser::event(self, t_ns as f64 * 1e-9, event);
    }
}

fn row<S: Clone>(t_ns: u64, sample: &S) -> Row<S> {
    let v = sample.clone();
    Row { t_ns, v }
}

/// Index of the first joint of a leg; the left one's if none moves.
fn first_joint(leg: Option<LegChoice>) -> usize {
    match leg {
        Some(LegChoice::Right) => 3,
        Some(LegChoice::Left) | None => 0,
    }
}

/// The same from a whole recording.
#[must_use]
pub fn analyse(scenario: &Scenario, robot: &RobotConfig, recording: &Recording) -> Analysis {
    let mut analyser = Analyser::new(scenario, robot);
    for r in &recording.master {
        analyser.master(r.t_s(), &r.v);
    }
    for (joint, rows) in recording.joints.iter().enumerate() {
        rows.iter().for_each(|r| analyser.joint(joint, r));
    }
    for (wheel, rows) in recording.wheels.iter().enumerate() {
        rows.iter().for_each(|r| analyser.wheel(wheel, r));
    }
    for r in &recording.events {
        analyser.event(r.t_s(), &r.v);
    }
    // The robot's travel uses the feet's values of the same time.
    let mut feet = recording.feet.each_ref().map(|rows| rows.iter().peekable());
    for body in &recording.body {
        for (foot, rows) in feet.iter_mut().enumerate() {
            while let Some(r) = rows.next_if(|r| r.t_ns <= body.t_ns) {
                analyser.foot(foot, r.t_ns, &r.v);
            }
        }
        analyser.body(body.t_s(), &body.v);
    }
    for (foot, rows) in feet.into_iter().enumerate() {
        rows.for_each(|r| analyser.foot(foot, r.t_ns, &r.v));
    }
    recording.supply.iter().for_each(|r| analyser.supply(r));
    analyser.finish()
}

/// Time of the first event of a kind on the recording's clock, s.
fn event_time(scenario: &Scenario, is: impl Fn(&EventAction) -> bool) -> Option<f64> {
    scenario
        .events
        .iter()
        .find(|e| is(&e.action))
        .map(|e| e.at_s)
}

/// Smallest and largest of the values so far; `None` before the first.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Extremes(pub(crate) Option<(f64, f64)>);

impl Extremes {
    pub(crate) fn add(&mut self, value: f64) {
        let (lo, hi) = self.0.unwrap_or((value, value));
        self.0 = Some((lo.min(value), hi.max(value)));
    }

    /// Largest less smallest.
    pub(crate) fn span(self) -> Option<f64> {
        self.0.map(|(lo, hi)| hi - lo)
    }
}

/// Whether `from <= t < to`, in s.
pub(crate) fn within<S>(row: &Row<S>, from_s: f64, to_s: f64) -> bool {
    let t_s = row.t_s();
    t_s >= from_s - 1e-9 && t_s < to_s - 1e-9
}

/// Rows with `from <= t < to`, in s.
pub(crate) fn window<S>(rows: &[Row<S>], from_s: f64, to_s: f64) -> &[Row<S>] {
    let index = |t: f64| rows.partition_point(|r| r.t_s() < t - 1e-9);
    let (a, b) = (index(from_s), index(to_s));
    &rows[a..b.max(a)]
}
