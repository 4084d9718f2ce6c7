//! Checks a scenario's motion and commands against the robot that carries them out.
//!
//! A command can replace values of the robot's file during a run. Each relation in which such a value takes
//! part is judged again with it: those of a gait at once, those of a board's parameters when the board is
//! armed with them, or at the end if they are left so. Demands of a motion or a command on a cylinder or a
//! leg are not fields of the robot's file, and have no entry in the table.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::{replace, take};

use wheeleg_master::command::Command;
use wheeleg_master::contact::Side;
use wheeleg_master::layer1::foot::{FootShape, FootTrajectory};
use wheeleg_master::layer1::params::{GaitParams as MasterGait, ParamError, Pattern, STROKE_MM};
use wheeleg_master::setpoint::{Cylinder, JointSetpoint, Setpoints};
use wheeleg_node::acceptance::accepts;
use wheeleg_protocol::Node;
use wheeleg_protocol::param::JOINT_PARAMS;
use wheeleg_units::PositionMm;

use super::advice::{self, Search};
use super::{Facts, Found, ROUNDING, Rule, Tried, broken, broken_whole};
use crate::board_value::in_unit;
use crate::error::ConfigError;
use crate::gait::GaitParams;
use crate::node::set;
use crate::params::{ParameterInfo, Params as _};
use crate::quantity::{pretty, suffix};
use crate::reader::Reader;
use crate::scenario::{EventAction, LegChoice, Motion, Scenario};
use crate::{Advised, RobotConfig, command};

/// Fields of a gait that determine its start pose.
const POSE: [&str; 4] = [
    "gait.yaw_s2",
    "gait.stroke",
    "gait.held_leg_s5",
    "gait.held_leg_s6",
];
/// Field of the stroke of all cylinders.
const STROKE: &str = "cylinder.stroke";

impl Scenario {
    /// Checks whether this robot can do what the motion and the commands ask for.
    ///
    /// # Errors
    /// [`ConfigError`] with everything that it cannot do: the fields of the scenario and of the robot, and
    /// the allowed values.
    pub fn check_with(&self, robot: &RobotConfig) -> Result<(), ConfigError> {
        Judge::new(self, robot).all()
    }
}

/// A joint board whose parameters a scenario writes.
struct Board {
    /// Its parameters, by number.
    stored: Vec<(u16, i32)>,
    /// The last event that wrote each parameter.
    writers: BTreeMap<u16, usize>,
    judged: bool,
    /// Relations for which it was refused, with the values of their fields.
    refused: BTreeSet<Refused>,
}

/// The name of a relation and the bits of its fields' values.
type Refused = (&'static str, Vec<Vec<u64>>);

struct Judge<'a> {
    scenario: &'a Scenario,
    robot: &'a RobotConfig,
    /// The scenario's file, read again if one of its values is needed, with the errors.
    reader: Option<Reader>,
    /// Parameters of the robot, with the values of the newest gait.
    parameters: Vec<ParameterInfo>,
    gait: MasterGait,
    /// Poses in which it stands, by the bits of their fields.
    poses: BTreeSet<[u64; POSE.len()]>,
    boards: Vec<Board>,
    disarmed: bool,
    /// Whether an emergency stop holds the boards: clearing it leaves them disarmed.
    stopped: bool,
}

/// Field of a scenario that replaces one of the robot, by the path of that one, and its description beside
/// its path.
type Brought = BTreeMap<String, (String, String)>;

impl<'a> Judge<'a> {
    fn new(scenario: &'a Scenario, robot: &'a RobotConfig) -> Self {
        let side = side(scenario.motion.stepping_leg());
        let boards = robot.node.joints.iter().map(|stored| Board {
            stored: stored.clone(),
            writers: BTreeMap::new(),
            judged: true,
            refused: BTreeSet::new(),
        });
        let mut judge = Self {
            scenario,
            robot,
            reader: None,
            parameters: robot.parameters.clone(),
            gait: robot.gait.of_master(Pattern::Single(side)),
            poses: BTreeSet::new(),
            boards: boards.collect(),
            disarmed: false,
            stopped: false,
        };
        // Otherwise its file was refused.
        judge.poses.insert(judge.pose());
        judge
    }

    fn all(mut self) -> Result<(), ConfigError> {
        self.motion()?;
        for event in &self.scenario.events {
            let (command, at) = match (&event.action, event.place.0) {
                (EventAction::EStop, _) => (&Command::EmergencyStop, 0),
                (EventAction::ClearFault, _) => (&Command::ClearFault, 0),
                (EventAction::Command(command), Some(at)) => (command, at),
                _ => continue,
            };
            let path = format!("events[{at}]");
            match *command {
                Command::SetGait(gait) => self.set_gait(at, gait)?,
                Command::JointReference { .. } => self.reference(at)?,
                Command::FootTrajectory { side, shape } => {
                    self.foot(&path, ["forward", "left", "height"], side, shape)?;
                }
                Command::Walk(_) => self.walk(&path, "command")?,
                Command::WriteParameter { node, id, raw } => self.write(at, node, id, raw)?,
                Command::Disarm => self.disarmed = true,
                Command::EmergencyStop => self.stopped = true,
                Command::ClearFault => self.disarmed |= take(&mut self.stopped),
                Command::Arm => self.arm()?,
                _ => {}
            }
        }
        self.arm()?;
        let what = self.what();
        match self.reader {
            Some(reader) if !reader.is_clean() => Err(reader.refusal(&what)),
            _ => Ok(()),
        }
    }

    fn what(&self) -> String {
        format!(
            "the scenario file {} is not usable with the robot file {}",
            self.scenario.source.0.file, self.robot.file
        )
    }

    fn reader(&mut self) -> Result<&mut Reader, ConfigError> {
        let reader = match self.reader.take() {
            Some(reader) => reader,
            None => {
                let source = &self.scenario.source.0;
                Reader::parse(&self.what(), &source.file, &source.text, false)?
            }
        };
        Ok(self.reader.insert(reader))
    }

    /// The quantities of an event as written, by their keys.
    fn written(&mut self, at: usize) -> Result<BTreeMap<String, ParameterInfo>, ConfigError> {
        let reader = self.reader()?;
        let entry = reader.entry("events", at);
        let before = reader.parameters().len();
        // It was accepted before.
        let _ = command::read(reader, &entry, &[]);
        let own = reader.parameters().iter().skip(before);
        let own = own.filter_map(|info| {
            let (_, key) = info.path.rsplit_once('.')?;
            Some((key.to_owned(), info.clone()))
        });
        Ok(own.collect())
    }

    /// A field of the robot, for a message.
    fn of_robot(&self, path: &str) -> String {
        let info = self.robot.parameters.iter().find(|p| p.path == path);
        let value = info.map_or(String::new(), |p| {
            format!(" = {}{}", p.value_text(), suffix(&p.unit))
        });
        format!("`{path}`{value} of {}", self.robot.file)
    }

    /// Reports a demand of these fields of the scenario that the robot's `path` does not allow.
    fn refuse(
        &mut self,
        fields: &[String],
        paths: &[&str],
        (why, allowed): (&str, &str),
        advice: Vec<Vec<Advised>>,
    ) -> Result<(), ConfigError> {
        let of_robot: Vec<String> = paths.iter().map(|path| self.of_robot(path)).collect();
        let reader = self.reader()?;
        let mut shown: Vec<String> = fields.iter().map(|field| reader.shown(field)).collect();
        shown.extend(of_robot);
        let first = fields.iter().find_map(|field| reader.span_of(field));
        reader.contradiction_at(first, &shown, (why, allowed), advice);
        Ok(())
    }

    fn motion(&mut self) -> Result<(), ConfigError> {
        match self.scenario.motion {
            Motion::Stand | Motion::SquareWave { .. } => Ok(()),
            Motion::Walk(order) => {
                self.walk("motion", "kind")?;
                // The robot is set down with its nose that low.
                let left_m = self.robot.gait.stroke_m + order.nose_mm.to_f64() * 1e-3;
                if left_m >= -ROUNDING {
                    return Ok(());
                }
                let least_mm = -self.robot.gait.stroke_m * 1e3;
                let field = "motion.nose".to_owned();
                let allowed = format!(
                    "`{field}` is allowed from {} to 0 mm, `gait.stroke` below 0",
                    pretty(least_mm)
                );
                let why = "the legs would be drawn in further than they are out";
                let advice = vec![vec![Advised {
                    path: field.clone(),
                    value: least_mm,
                    unit: "mm".to_owned(),
                }]];
                self.refuse(&[field], &["gait.stroke"], (why, &allowed), advice)
            }
            Motion::Sinusoid {
                leg,
                length_m,
                height_m,
                rate_rad_s,
            } => {
                let shape = FootShape::Arch {
                    forward_mm: PositionMm::from_f64(length_m * 1e3),
                    left_mm: PositionMm::ZERO,
                    height_mm: PositionMm::from_f64(height_m * 1e3),
                    rate_rad_s: rate_rad_s as f32,
                };
                self.foot("motion", ["length", "", "height"], side(leg), shape)
            }
        }
    }

    /// The shortest stroke of the cylinders, m.
    fn stroke_m(&self) -> f64 {
        let strokes = self.robot.plant.cylinders.iter().map(|c| c.stroke_m);
        strokes.fold(f64::INFINITY, f64::min)
    }

    /// Checks a walk, which is planned with the strokes of the paper's leg.
    fn walk(&mut self, path: &str, key: &str) -> Result<(), ConfigError> {
        let least_m = STROKE_MM.to_f64() * 1e-3;
        if self.stroke_m() >= least_m * (1.0 - ROUNDING) {
            return Ok(());
        }
        let allowed = format!("`{STROKE}` is allowed from {} mm", pretty(least_m * 1e3));
        let why = "a walk would drive the pistons into their stops";
        self.refuse(
            &[format!("{path}.{key}")],
            &[STROKE],
            (why, &allowed),
            Vec::new(),
        )
    }

    /// Checks a reference that no piston may reach.
    fn reference(&mut self, at: usize) -> Result<(), ConfigError> {
        let most_m = self.stroke_m();
        // The command's own limit is narrower.
        if most_m >= STROKE_MM.to_f64() * 1e-3 {
            return Ok(());
        }
        let written = self.written(at)?;
        let Some(stroke) = written.get("stroke") else {
            return Ok(());
        };
        let factor = stroke.dimension.and_then(|d| d.factor(&stroke.unit));
        let factor = factor.unwrap_or(1.0);
        if stroke.value[0] * factor <= most_m * (1.0 + ROUNDING) {
            return Ok(());
        }
        let most = most_m / factor;
        let allowed = format!(
            "`{}` is allowed up to {}{}",
            stroke.path,
            pretty(most),
            suffix(&stroke.unit)
        );
        let advice = vec![vec![Advised {
            path: stroke.path.clone(),
            value: most,
            unit: stroke.unit.clone(),
        }]];
        let why = "the piston would be driven into its stop";
        self.refuse(
            std::slice::from_ref(&stroke.path),
            &[STROKE],
            (why, &allowed),
            advice,
        )
    }

    /// Whether the foot of `side` can move this far forward, to the left and up, mm, from the start pose.
    fn reaches(&self, side: Side, [forward, left, height]: [f64; 3], rate_rad_s: f32) -> bool {
        let mut leg = self.robot.walk_geometry().leg;
        let stroke_m = self.stroke_m() as f32;
        leg.stroke_m = leg.stroke_m.map(|of_master_m| of_master_m.min(stroke_m));
        let mut start = Setpoints::idle(0);
        let cylinders = [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical];
        for (cylinder, reference_mm) in cylinders.into_iter().zip(self.gait.start_pose(side)) {
            start.joints[side.joint(cylinder)] = Some(JointSetpoint {
                reference_mm,
                ..JointSetpoint::default()
            });
        }
        let shape = FootShape::Arch {
            forward_mm: PositionMm::from_f64(forward),
            left_mm: PositionMm::from_f64(left),
            height_mm: PositionMm::from_f64(height),
            rate_rad_s,
        };
        let path = FootTrajectory::new(shape, leg, side, start, 0);
        !matches!(path, Err(ParamError::OutOfReach { .. }))
    }

    /// Checks a path that may leave the reach of its leg. `keys`: fields of the three lengths.
    fn foot(
        &mut self,
        path: &str,
        keys: [&str; 3],
        side: Side,
        shape: FootShape,
    ) -> Result<(), ConfigError> {
        let FootShape::Arch {
            forward_mm,
            left_mm,
            height_mm,
            rate_rad_s,
        } = shape
        else {
            return Ok(());
        };
        let asked = [forward_mm, left_mm, height_mm].map(|mm| mm.to_f64());
        if self.reaches(side, asked, rate_rad_s) {
            return Ok(());
        }
        let mut fields = Vec::new();
        let (mut allowed, mut advice) = (Vec::new(), Vec::new());
        for (i, key) in keys.into_iter().enumerate() {
            if key.is_empty() {
                continue;
            }
            let field = format!("{path}.{key}");
            if let Some(most) = self.farthest(side, asked, i, rate_rad_s) {
                let word = if asked[i] < 0.0 { "from" } else { "up to" };
                allowed.push(format!("`{field}` is allowed {word} {} mm", pretty(most)));
                advice.push(vec![Advised {
                    path: field.clone(),
                    value: most,
                    unit: "mm".to_owned(),
                }]);
            }
            fields.push(field);
        }
        let allowed = match allowed.is_empty() {
            true => "shorter ways are allowed: no one of them alone is enough".to_owned(),
            false => allowed.join(", or "),
        };
        let why = "the foot would leave the reach of its leg";
        let paths = ["gait.stroke", STROKE, "body.stroke_zero", "body.crank"];
        self.refuse(&fields, &paths, (why, &allowed), advice)
    }

    /// The largest length in one direction for which the path is in reach, in tenths of a millimetre.
    fn farthest(&self, side: Side, asked: [f64; 3], i: usize, rate_rad_s: f32) -> Option<f64> {
        let with = |tenths: f64| {
            let mut asked = asked;
            asked[i] = (0.1 * tenths).copysign(asked[i]);
            asked
        };
        let reaches = |tenths: f64| self.reaches(side, with(tenths), rate_rad_s);
        let (mut within, mut beyond) = (0.0, (10.0 * asked[i].abs()).ceil());
        if beyond == 0.0 || !reaches(within) {
            return None;
        }
        while beyond - within > 1.0 {
            let middle = (0.5 * (within + beyond)).floor();
            if reaches(middle) {
                within = middle;
            } else {
                beyond = middle;
            }
        }
        Some(with(within)[i])
    }

    fn pose(&self) -> [u64; POSE.len()] {
        let facts = facts(&self.parameters);
        POSE.map(|path| facts.si(path).unwrap_or(f64::NAN).to_bits())
    }

    /// Checks and takes over another gait.
    fn set_gait(&mut self, at: usize, gait: MasterGait) -> Result<(), ConfigError> {
        if replace(&mut self.gait, gait) == gait {
            return Ok(());
        }
        let written = self.written(at)?;
        let mut brought = Brought::new();
        for spec in GaitParams::FIELDS {
            let path = format!("gait.{}", spec.key);
            let own = self.parameters.iter_mut().find(|p| p.path == path);
            if let (Some(own), Some(info)) = (own, written.get(spec.key)) {
                brought.insert(path.clone(), (info.path.clone(), String::new()));
                *own = ParameterInfo {
                    path,
                    ..info.clone()
                };
            }
        }
        let new_pose = self.poses.insert(self.pose());
        let parameters = take(&mut self.parameters);
        let judged = self.judge(&parameters, &brought, new_pose, &mut BTreeSet::new());
        self.parameters = parameters;
        judged
    }

    /// Takes over a parameter that a joint's board accepts; a refused one changes nothing.
    fn write(&mut self, at: usize, node: u8, id: u16, raw: i32) -> Result<(), ConfigError> {
        let index = usize::from(node).wrapping_sub(1);
        let info = JOINT_PARAMS.iter().find(|info| info.id == id);
        let (Some(board), Some(node), Some(info)) =
            (self.boards.get_mut(index), Node::new(node), info)
        else {
            return Ok(());
        };
        if info.disarmed_only && !self.disarmed {
            return Ok(());
        }
        let mut stored = board.stored.clone();
        set(&mut stored, id, raw);
        if !accepts(node.address(), &stored) {
            return Ok(());
        }
        board.stored = stored;
        board.writers.insert(id, at);
        board.judged = false;
        match self.disarmed {
            true => Ok(()),
            false => self.judge_board(index),
        }
    }

    /// Arms all boards with their parameters.
    fn arm(&mut self) -> Result<(), ConfigError> {
        self.disarmed = false;
        (0..self.boards.len()).try_for_each(|index| self.judge_board(index))
    }

    fn judge_board(&mut self, index: usize) -> Result<(), ConfigError> {
        let board = &mut self.boards[index];
        if replace(&mut board.judged, true) {
            return Ok(());
        }
        let mut parameters = self.parameters.clone();
        let mut brought = Brought::new();
        for (id, at) in &board.writers {
            let info = JOINT_PARAMS.iter().find(|info| info.id == *id);
            let value = board.stored.iter().find(|(stored, _)| stored == id);
            let (Some(info), Some((_, raw))) = (info, value) else {
                continue;
            };
            let path = format!("node.joint.{}", info.name);
            if let Some(own) = parameters.iter_mut().find(|p| p.path == path) {
                own.value = vec![in_unit(info, *raw)];
            }
            let called = format!(", the `{}` of board {}", info.name, index + 1);
            brought.insert(path, (format!("events[{at}].value"), called));
        }
        // An error that stays the same is reported once, whatever else is written.
        let mut refused = take(&mut board.refused);
        let judged = self.judge(&parameters, &brought, false, &mut refused);
        self.boards[index].refused = refused;
        judged
    }

    /// Judges the table with the values that the scenario brought; `new_pose`: in another start pose, too.
    /// Leaves out errors that are in `refused`, and adds those that it reports.
    fn judge(
        &mut self,
        parameters: &[ParameterInfo],
        brought: &Brought,
        new_pose: bool,
        refused: &mut BTreeSet<Refused>,
    ) -> Result<(), ConfigError> {
        let plant = &self.robot.plant;
        let whole = |facts: &Facts<'_>| {
            let judged = new_pose.then(|| broken_whole(facts, plant));
            judged.flatten()
        };
        let facts = facts(parameters);
        let mut found = broken(&facts);
        if found.is_empty() {
            found.extend(whole(&facts));
        }
        // The robot is fixed: only values of the scenario's own fields can mend it.
        let attempt = |values: &[Advised]| {
            let mut tried = parameters.to_vec();
            for Advised { path, value, .. } in values {
                let own = tried.iter_mut().find(|p| p.path == *path)?;
                let allowed = brought.contains_key(path) && (own.min..=own.max).contains(value);
                allowed.then_some(())?;
                own.value = vec![*value];
            }
            let facts = self::facts(&tried);
            Some(Tried {
                found: broken(&facts),
                whole: whole(&facts).map(|found| found.relation.name),
                others: 0,
            })
        };
        let search = Search::new(&found, 0, &attempt);
        let mut told = Vec::new();
        for (at, one) in found.iter().enumerate() {
            let accepted = search.accepted(one, found.len() - at);
            let untried = search.is_cut_short() && found.len() > 1;
            let renamed = advice::renamed(accepted, |path| {
                let own = brought.get(path);
                own.map_or(path, |(field, _)| field.as_str()).to_owned()
            });
            told.push((
                one.relation
                    .message(&one.broken, &renamed, untried.then_some(&[][..])),
                advice::values(&renamed),
            ));
        }
        for (one, ((why, allowed), advice)) in found.iter().zip(told) {
            // Errors caused by an earlier event have been reported there.
            let is_own = one
                .relation
                .fields
                .iter()
                .any(|field| brought.contains_key(*field));
            if !is_own && !new_pose {
                continue;
            }
            let said = one.relation.fields.iter().map(|field| {
                let info = parameters.iter().find(|info| info.path == **field);
                let value = info.map_or(&[][..], |info| &info.value);
                value.iter().map(|value| value.to_bits()).collect()
            });
            if !refused.insert((one.relation.name, said.collect())) {
                continue;
            }
            self.report(one, parameters, brought, (&why, &allowed), advice)?;
        }
        Ok(())
    }

    fn report(
        &mut self,
        found: &Found,
        parameters: &[ParameterInfo],
        brought: &Brought,
        told: (&str, &str),
        advice: Vec<Vec<Advised>>,
    ) -> Result<(), ConfigError> {
        let mut paths = found.relation.fields.to_vec();
        if let Rule::AtRest(_) = found.relation.rule {
            // Standing and load depend on the pose.
            let missing = POSE
                .iter()
                .filter(|path| !found.relation.fields.contains(path));
            paths.extend(missing);
        }
        let info = |path: &str| parameters.iter().find(|p| p.path == path);
        paths.retain(|path| info(path).is_some());
        let (own, others): (Vec<&str>, Vec<&str>) = paths
            .into_iter()
            .partition(|path| brought.contains_key(*path));
        let of_robot: Vec<String> = others.iter().map(|path| self.of_robot(path)).collect();
        let reader = self.reader()?;
        let mut shown = Vec::new();
        let mut first = None;
        for path in own {
            let (Some(info), Some((field, called))) = (info(path), brought.get(path)) else {
                continue;
            };
            let (value, unit) = (info.value_text(), suffix(&info.unit));
            let line = reader.line_of(field);
            shown.push(format!("`{field}` = {value}{unit}{line}{called}"));
            first = first.or_else(|| reader.span_of(field));
        }
        shown.extend(of_robot);
        reader.contradiction_at(first, &shown, told, advice);
        reader.breaks(found.relation.name);
        Ok(())
    }
}

fn facts(parameters: &[ParameterInfo]) -> Facts<'_> {
    Facts {
        parameters,
        moved: None,
        axis: None,
    }
}

fn side(leg: LegChoice) -> Side {
    match leg {
        LegChoice::Left => Side::Left,
        LegChoice::Right => Side::Right,
    }
}
