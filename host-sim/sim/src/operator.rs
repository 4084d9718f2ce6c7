//! The person at the console: gets the robot ready, starts the motion, and
//! carries out the scenario's events, all through the master's dispatcher.

use wheeleg_master::Master;
use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::{Refusal, Reject, Ticket};
use wheeleg_master::event::Event;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_protocol::{LinkRecord, Node};
use wheeleg_units::PositionMm;

use super::world::World;
use crate::SimError;
use wheeleg_config::{LegChoice, Motion, RobotConfig, Scenario, ScenarioEvent};
use wheeleg_telemetry::event::{Answer, Cause};
use wheeleg_telemetry::messages::reject;
use wheeleg_telemetry::{Event as Recorded, EventKind, LinkSample, Recorder};

/// Remedy for a robot that does not get ready, if no board is to blame: its file, and the values there that
/// decide whether its air moves it in time.
fn remedy(robot: &RobotConfig) -> String {
    let plant = &robot.plant;
    let told = robot.told_otherwise();
    let told = match told.as_slice() {
        [] => String::new(),
        _ => format!(
            "the boards are told otherwise than it is: {}; ",
            told.join("; ")
        ),
    };
    format!(
        "{told}correct the robot {}: with {:.1} kg in all (`body.chassis_mass`, `link.*.mass`), \
         `supply.set_pressure` = {:.2} bar, `cylinder.bore` = {:.1} mm, `cylinder.rod` = {:.1} mm, \
         `friction.static` = {:.1} N, \
         `sensor.adc.bits` = {} and its `[node.*]` sections the joints do not come to rest within \
         `homing.tolerance` = {:.1} mm in `homing.timeout` = {:.1} s",
        robot.file,
        plant.body.total_mass_kg(),
        plant.supply.set_pressure_pa * 1e-5,
        plant.cylinders[0].bore_m * 1e3,
        plant.cylinders[0].rod_m * 1e3,
        plant.cylinders[0].friction.static_n,
        plant.adc.bits,
        robot.homing.tolerance_m * 1e3,
        robot.homing.timeout_s,
    )
}

/// The move of each joint before a run in which `leg` steps, with the fields that set it: that leg is drawn
/// back, the other held.
fn moves(robot: &RobotConfig, leg: LegChoice) -> [String; 6] {
    let gait = &robot.gait;
    let drawn = [
        ("yaw", "`gait.yaw_s2`", gait.yaw_s2_m),
        ("horizontal", "0", 0.0),
        ("vertical", "`gait.stroke`", gait.stroke_m),
    ];
    let held = [
        ("yaw", "`gait.yaw_s2`", gait.yaw_s2_m),
        ("horizontal", "`gait.held_leg_s5`", gait.held_leg_s5_m),
        ("vertical", "`gait.held_leg_s6`", gait.held_leg_s6_m),
    ];
    let legs = match leg {
        LegChoice::Left => [drawn, held],
        LegChoice::Right => [held, drawn],
    };
    std::array::from_fn(|joint| {
        let (start, field, to_m) = legs[joint / 3][joint % 3];
        let from_mm = robot.plant.initial_stroke_m[joint] * 1e3;
        format!(
            "joint {} goes from `start.{start}.stroke` = {from_mm:.1} mm to {field} = {:.1} mm, where \
             the robot has to come to rest; ",
            joint + 1,
            to_m * 1e3
        )
    })
}

/// Legs of different heights in the start pose, with the fields that say so: the robot leans on its held
/// leg or on the one that steps. Empty where they are alike.
fn uneven(robot: &RobotConfig) -> String {
    let gait = &robot.gait;
    let (stroke_m, held_m) = (gait.stroke_m, gait.held_leg_s6_m);
    if (stroke_m - held_m).abs() <= robot.homing.tolerance_m {
        return String::new();
    }
    format!(
        "in the start pose the feet are not level, and the robot does not stand on both: \
         `gait.stroke` = {:.1} mm and `gait.held_leg_s6` = {:.1} mm differ; ",
        stroke_m * 1e3,
        held_m * 1e3
    )
}

/// Between two looks at a reservoir that is not full yet, ns.
const FILLING_NS: u64 = 100_000_000;

/// Stage of the start-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Enumerating,
    Arming,
    /// The reservoir is not full yet.
    Filling {
        until_ns: u64,
    },
    Homing,
    Settling {
        until_ns: u64,
    },
}

impl Stage {
    /// Name, for messages.
    const fn name(self) -> &'static str {
        match self {
            Self::Enumerating => "finding the boards",
            Self::Arming => "arming",
            Self::Filling { .. } => "waiting for air",
            Self::Homing => "moving to the start pose",
            Self::Settling { .. } => "settling in the start pose",
        }
    }
}

/// The operator of one run.
pub(super) struct Operator {
    motion: Motion,
    events: Vec<ScenarioEvent>,
    rest_ns: u64,
    limit_ns: u64,
    stage: Stage,
    /// What the master reported during the start-up, µs after power-up.
    start_up: Vec<(u64, Cause)>,
    next_event: usize,
    flood_refused: bool,
    /// Remedy if the robot does not get ready.
    remedy: String,
    /// The move of each joint.
    moves: [String; 6],
    /// Legs of different heights in the start pose.
    uneven: String,
    /// What to do where the time is not enough.
    late_remedy: String,
    /// Remedy if a board refuses to be armed.
    arming_remedy: String,
    /// Remedy if the reservoir does not fill.
    air_remedy: String,
}

/// Side of a leg as the master names it.
pub(super) fn side(leg: LegChoice) -> Side {
    match leg {
        LegChoice::Left => Side::Left,
        LegChoice::Right => Side::Right,
    }
}

impl Operator {
    /// An operator at a robot that is just being switched on.
    pub(super) fn new(scenario: &Scenario, robot: &RobotConfig) -> Self {
        let ns = |s: f64| (s * 1e9).round() as u64;
        Self {
            motion: scenario.motion,
            events: scenario.events.clone(),
            rest_ns: ns(robot.start_up.rest_s),
            limit_ns: ns(robot.start_up.limit_s),
            stage: Stage::Enumerating,
            start_up: Vec::new(),
            next_event: 0,
            flood_refused: false,
            remedy: remedy(robot),
            moves: moves(robot, scenario.motion.stepping_leg()),
            uneven: uneven(robot),
            late_remedy: format!(
                "`start_up.limit` = {:.2} s of the robot {} is over, of which its rest, `start_up.rest`, \
                 takes {:.2} s: allow more time",
                robot.start_up.limit_s, robot.file, robot.start_up.rest_s
            ),
            arming_remedy: format!(
                "correct the robot {}: a board that reports a fault cannot be armed; its sensor \
                 (`[sensor.*]`, `cylinder.stroke`) and its parameters (`[node.*]`) must agree",
                robot.file
            ),
            air_remedy: format!(
                "the robot {} is armed once its reservoir has `supply.switch_on` = {:.2} bar; it begins with \
                 `supply.initial_pressure` = {:.2} bar, and is filled through its `[regulator]` up to \
                 `supply.set_pressure` = {:.2} bar: begin with more, or allow more than `start_up.limit` = {:.2} s",
                robot.file,
                robot.plant.supply.switch.on_pa * 1e-5,
                robot.plant.supply.initial_pressure_pa * 1e-5,
                robot.plant.supply.set_pressure_pa * 1e-5,
                robot.start_up.limit_s
            ),
        }
    }

    /// Checks the robot once during start-up; true once it stands at rest in its start pose.
    ///
    /// # Errors
    /// [`SimError::NotReady`] with the reason if it does not get there.
    pub(super) fn prepare(&mut self, world: &mut World) -> Result<bool, SimError> {
        let now_ns = world.now_ns();
        let now_us = now_ns / 1000;
        while let Some((time_us, event)) = world.master().take_event() {
            let cause = Cause::Master(event);
            if self.waits_for_air(event, now_ns) {
                continue;
            }
            // Counters and logs are no part of the story, unless something is to be mended.
            let routine = matches!(event, Event::Link { .. } | Event::Log { .. });
            if !routine || cause.kind() == EventKind::Fault {
                self.start_up.push((time_us, cause));
            }
            match event {
                Event::Homed if self.stage == Stage::Homing => {
                    self.stage = Stage::Settling {
                        until_ns: now_ns + self.rest_ns,
                    };
                }
                Event::Refused { .. } if self.stage == Stage::Arming => {
                    return Err(self.not_ready(now_ns, &self.arming_remedy));
                }
                Event::HomingFailed { .. } | Event::Hold(_) | Event::Refused { .. } => {
                    return Err(self.not_ready(now_ns, &self.remedy_of_pose()));
                }
                Event::SchemaMismatch { .. } => {
                    let help = "build and flash this board from the sources of this program; \
                         `wheeleg interface HASH --all` prints all that differs";
                    return Err(self.not_ready(now_ns, help));
                }
                Event::ForeignBoard { .. } => {
                    let help = "put the board back that was commissioned, or take this one over: \
                         `wheeleg commission`";
                    return Err(self.not_ready(now_ns, help));
                }
                _ => {}
            }
        }
        let (command, next) = match self.stage {
            Stage::Enumerating if world.master().is_ready() => (Command::Arm, Stage::Arming),
            Stage::Arming if world.master().is_armed() => {
                if matches!(self.motion, Motion::Walk(_)) {
                    // A walk begins where the robot stands.
                    self.stage = Stage::Settling {
                        until_ns: now_ns + self.rest_ns,
                    };
                    return Ok(false);
                }
                (Command::Stand, Stage::Homing)
            }
            Stage::Settling { until_ns } if now_ns >= until_ns && now_ns <= self.limit_ns => {
                return Ok(true);
            }
            Stage::Filling { .. } if now_ns > self.limit_ns => {
                return Err(self.not_ready(now_ns, &self.air_remedy));
            }
            Stage::Filling { until_ns } if now_ns >= until_ns => (Command::Arm, Stage::Arming),
            Stage::Homing | Stage::Settling { .. } if now_ns > self.limit_ns => {
                return Err(self.not_ready(now_ns, &self.late_remedy));
            }
            // Boards that are not found, or not armed, may lack something other than time.
            _ if now_ns > self.limit_ns => {
                let help = format!("{}; or {}", self.late_remedy, self.remedy);
                return Err(self.not_ready(now_ns, &help));
            }
            _ => return Ok(false),
        };
        world
            .master()
            .submit(command, now_us)
            .map_err(|why| refused(&command, &why))?;
        self.stage = next;
        Ok(false)
    }

    /// Whether arming is refused for want of air, which may still come: it is asked for again.
    fn waits_for_air(&mut self, event: Event, now_ns: u64) -> bool {
        let no_air = matches!(
            event,
            Event::Refused {
                reason: Refusal::NoAir,
                ..
            }
        );
        let waits = no_air && self.stage == Stage::Arming;
        if waits {
            let until_ns = now_ns + FILLING_NS;
            self.stage = Stage::Filling { until_ns };
        }
        waits
    }

    /// The remedy, with the move of the joint that reported last, or with the fields that lead a wheel.
    fn remedy_of_pose(&self) -> String {
        let mut faults = self.start_up.iter().rev().map(|(_, cause)| cause);
        let fault = faults.find(|cause| cause.kind() == EventKind::Fault);
        if let Some(wheel) = fault
            .and_then(Cause::board)
            .filter(|board| !board.is_joint())
        {
            return format!(
                "`[node.wheel]` and `[motor]` of the robot decide whether the loop of {wheel} is stable, which \
                 reports this; {}",
                self.remedy
            );
        }
        // A walk begins where the robot stands.
        if matches!(self.motion, Motion::Walk(_)) {
            return self.remedy.clone();
        }
        let mut boards = self.start_up.iter().rev().map(|(_, cause)| cause.board());
        let joint = boards.find_map(|board| {
            let joint = board.filter(|board| board.is_joint())?;
            self.moves.get(usize::from(joint.raw()) - 1)
        });
        let moves = joint.map_or("", String::as_str);
        format!("{}{moves}{}", self.uneven, self.remedy)
    }

    fn not_ready(&self, now_ns: u64, help: &str) -> SimError {
        let story: Vec<String> = self
            .start_up
            .iter()
            .rev()
            .take(6)
            .rev()
            .map(|(us, cause)| format!("{:.3} s: {cause}", *us as f64 * 1e-6))
            .collect();
        SimError::NotReady {
            what: format!(
                "the robot did not get ready in {:.2} s of simulated time (stage: {}); last events: {}",
                now_ns as f64 * 1e-9,
                self.stage.name(),
                story.join("; ")
            ),
            help: help.to_owned(),
        }
    }

    /// Writes the story of the start-up into the record, at time 0.
    pub(super) fn report_start_up(&self, recorder: &mut Recorder) {
        for (us, cause) in &self.start_up {
            recorder.event(0, Recorded::of_start_up(cause.clone(), *us));
        }
    }

    /// Starts the scenario's motion.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the dispatcher refuses it.
    pub(super) fn begin(&self, world: &mut World) -> Result<(), SimError> {
        let command = match self.motion {
            Motion::Stand => return Ok(()),
            Motion::SquareWave { .. } => Command::StartGait,
            Motion::Walk(order) => Command::Walk(order),
            Motion::Sinusoid {
                leg,
                length_m,
                height_m,
                rate_rad_s,
            } => Command::FootTrajectory {
                side: side(leg),
                shape: FootShape::Arch {
                    forward_mm: PositionMm::from_f64(length_m * 1e3),
                    left_mm: PositionMm::ZERO,
                    height_mm: PositionMm::from_f64(height_m * 1e3),
                    rate_rad_s: rate_rad_s as f32,
                },
            },
        };
        let now_us = world.now_ns() / 1000;
        world
            .master()
            .submit(command, now_us)
            .map(|_| ())
            .map_err(|why| refused(&command, &why))
    }

    /// The events of the scenario that are due at `t_ns`, each once.
    pub(super) fn due(&mut self, t_ns: u64) -> Vec<ScenarioEvent> {
        let t_s = t_ns as f64 * 1e-9;
        let rest = &self.events[self.next_event..];
        let due: Vec<ScenarioEvent> = rest
            .iter()
            .take_while(|e| e.at_s <= t_s + 1e-9)
            .cloned()
            .collect();
        self.next_event += due.len();
        due
    }

    /// Gives a command in mid-run. A refusal is an event, as on the real console.
    pub(super) fn submit(
        &self,
        world: &mut World,
        command: Command,
        t_ns: u64,
        recorder: &mut Recorder,
    ) -> Answer {
        let answer = world.master_alive().then(|| world.submit(command));
        record_answer(command.code(), answer, t_ns, recorder)
    }

    /// A user who gives commands without end, as a fault of the run. The first
    /// refusal is an event; the others are counted by the master.
    pub(super) fn flood(&mut self, world: &mut World, t_ns: u64, recorder: &mut Recorder) {
        let now_us = world.now_ns() / 1000;
        for i in 0..world.faults().flood() {
            let joint = Node::JOINTS[i % Node::JOINTS.len()].number();
            let command = Command::TransmitPosition { joint };
            let answer = world.master().submit(command, now_us);
            if let (Err(reason), false) = (answer, self.flood_refused) {
                self.flood_refused = true;
                recorder.event(t_ns, Cause::Flood { number: i, reason });
            }
        }
    }
}

/// Writes the master's answer to a command into the record; `None`: it is dead and says nothing.
pub(super) fn record_answer(
    code: CommandCode,
    answer: Option<Result<Ticket, Reject>>,
    t_ns: u64,
    recorder: &mut Recorder,
) -> Answer {
    let answer = match answer {
        Some(Ok(_)) => Answer::Accepted,
        Some(Err(why)) => Answer::Rejected(why),
        None => Answer::Nothing,
    };
    recorder.event(t_ns, Cause::Command { code, answer });
    answer
}

/// Writes the master's events into the record, and passes them on.
pub(super) fn listen(
    master: &mut Master,
    t_ns: u64,
    recorder: &mut Recorder,
    on_event: &mut dyn FnMut(u64, &Event),
) {
    while let Some((time_us, event)) = master.take_event() {
        on_event(time_us, &event);
        // Counters have channels of their own.
        if let Event::Link { node, record } = event {
            if let Some(node) = Node::new(node) {
                recorder.link(t_ns, node.index(), link_sample(&record));
            }
            continue;
        }
        recorder.event(t_ns, Cause::Master(event));
    }
}

pub(super) fn refused(command: &Command, why: &Reject) -> SimError {
    SimError::simulation(
        format!(
            "the master refuses {}: {}",
            command.code().name(),
            reject(why)
        ),
        "the events in the log show what the robot was doing",
    )
}

fn link_sample(record: &LinkRecord) -> LinkSample {
    LinkSample {
        frames: record.frames,
        overflow: record.overflow,
        truncated: record.truncated,
        short: record.short,
        crc: record.crc,
        version: record.version,
        length: record.length,
        address: record.address,
        unsent: record.unsent,
        drift_ppm: i32::from(record.drift_ppm),
        parameters: record.parameters,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    #[test]
    fn legs_of_different_heights_are_told_by_their_fields() {
        let mut robot = builtin::robot("wheeleg").expect("built in");
        assert_eq!(uneven(&robot), "");
        robot.gait.stroke_m = 0.09;
        let said = uneven(&robot);
        for part in ["`gait.stroke` = 90.0 mm", "`gait.held_leg_s6` = 180.0 mm"] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
}
