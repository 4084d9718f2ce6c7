//! Reasons that stand inside an error: types without a code of their own, whose words are part of
//! another's message.

use std::error::Error;

use wheeleg_config::faults::FaultSpec;
use wheeleg_kinematics::{Cylinder, KinematicsError, Quantity};
use wheeleg_master::argument::{self, OutOfRange, Value};
use wheeleg_master::command::{ArgumentError, CommandCode};
use wheeleg_master::layer1::params::ParamError;
use wheeleg_plant::PlantError;
use wheeleg_plant::dynamics::DynamicsError;
use wheeleg_plant::terrain::{HeightMapError, RockError};
use wheeleg_remote_link::FrameError;
use wheeleg_studies::compare::{CaseId, UnknownVariation, Variation};
use wheeleg_units::PositionMm;

/// A reason with the words it must contain.
type Reason = (&'static str, Box<dyn Error>, Vec<&'static str>);

/// One of each variant, under the name `Type::Variant`.
pub(super) fn driven() -> Vec<Reason> {
    let mut all = Vec::new();
    plant(&mut all);
    kinematics(&mut all);
    commands(&mut all);
    texts(&mut all);
    let too_long = Box::new(FrameError::TooLong);
    all.push(("FrameError::TooLong", too_long, vec!["too long"]));
    let damaged = Box::new(FrameError::Damaged);
    all.push(("FrameError::Damaged", damaged, vec!["damaged"]));
    all
}

fn plant(all: &mut Vec<Reason>) {
    let (name, index, value) = ("velocity_m_s", 3, 250.0);
    let (min, max) = (-100.0, 100.0);
    let range = || vec!["velocity_m_s", "250", "-100 to 100"];
    let mut add = |name, error: PlantError, words| {
        let error: Box<dyn Error> = Box::new(error);
        all.push((name, error, words));
    };
    let endless = PlantError::NonFinite {
        name,
        index,
        value: f64::NAN,
    };
    add(
        "PlantError::NonFinite",
        endless,
        vec!["velocity_m_s", "NaN"],
    );
    let outside = PlantError::OutOfBounds {
        name,
        index,
        value,
        min,
        max,
    };
    add("PlantError::OutOfBounds", outside, range());
    let parameter = PlantError::Parameter {
        name,
        value,
        min,
        max,
    };
    add("PlantError::Parameter", parameter, range());
    let input = PlantError::Input {
        name,
        index,
        value,
        min,
        max,
    };
    add("PlantError::Input", input, range());
    let time = PlantError::Time {
        state_ns: 5,
        from_ns: 6,
        to_ns: 7,
    };
    add("PlantError::Time", time, vec!["5 ns", "6", "7 ns"]);
    let full = PlantError::EdgeQueueFull(2);
    add("PlantError::EdgeQueueFull", full, vec!["valve 2"]);
    let fallen = PlantError::NotStanding;
    add("PlantError::NotStanding", fallen, vec!["stand"]);
    let lying = PlantError::OnChassis {
        chassis_n: 61.5,
        feet_n: 20.25,
    };
    let words = vec!["lies on its chassis", "61.5 N", "20.25 N"];
    add("PlantError::OnChassis", lying, words);
    let within = PlantError::InChassis {
        place_m: [0.125, -0.25],
        into_m: 0.0625,
    };
    let words = vec!["chassis", "0.0625 m", "x = 0.125", "y = -0.25 m"];
    add("PlantError::InChassis", within, words);
    let mechanics = PlantError::Mechanics("a leg cannot close".to_owned());
    let words = vec!["a leg cannot close"];
    add("PlantError::Mechanics", mechanics, words);

    let mut add = |name, error: DynamicsError, words| {
        let error: Box<dyn Error> = Box::new(error);
        all.push((name, error, words));
    };
    let source = KinematicsError::BadParameter { value: -1.0 };
    let leg = DynamicsError::Leg { leg: 1, source };
    add("DynamicsError::Leg", leg, vec!["leg 1", "-1"]);
    let endless = DynamicsError::NonFinite {
        name: "force",
        index: 4,
        value: f64::INFINITY,
    };
    add("DynamicsError::NonFinite", endless, vec!["force[4]", "inf"]);
    let turned = DynamicsError::NotUnit { norm: 1.5 };
    add("DynamicsError::NotUnit", turned, vec!["1.5"]);
    let singular = DynamicsError::Singular { pivot: -0.25 };
    add("DynamicsError::Singular", singular, vec!["-0.25"]);
    let value = DynamicsError::Parameter {
        name: "track_m",
        value: -0.5,
    };
    add("DynamicsError::Parameter", value, vec!["track_m", "-0.5"]);

    let many: Box<dyn Error> = Box::new(RockError::TooMany);
    all.push(("RockError::TooMany", many, vec!["rocks"]));
    let full: Box<dyn Error> = Box::new(RockError::NoRoom {
        placed: 7,
        wanted: 90,
    });
    all.push(("RockError::NoRoom", full, vec!["7 of 90"]));
    let size: Box<dyn Error> = Box::new(HeightMapError::Size {
        columns: 1,
        rows: 9000,
    });
    let words = vec!["1 columns", "9000 rows", "2 to 4096"];
    all.push(("HeightMapError::Size", size, words));
    let steep: Box<dyn Error> = Box::new(HeightMapError::Steep {
        row: 3,
        column: 4,
        next_row: 3,
        next_column: 5,
        rise_m: 2.5,
        slope_deg: 88.0,
    });
    let words = vec!["row 3, column 4", "column 5", "2.5 m", "88.0°", "75°"];
    all.push(("HeightMapError::Steep", steep, words));
}

fn kinematics(all: &mut Vec<Reason>) {
    let mut add = |name, error: KinematicsError<f64>, words| {
        let error: Box<dyn Error> = Box::new(error);
        all.push((name, error, words));
    };
    let endless = KinematicsError::NonFinite {
        quantity: Quantity::FootPosition,
        value: f64::NAN,
    };
    let words = vec!["foot position", "NaN"];
    add("KinematicsError::NonFinite", endless, words);
    let axis = KinematicsError::FootOnYawAxis {
        radius_m: 0.01,
        minimum_m: 0.02,
    };
    let words = vec!["0.01 m", "0.02 m"];
    add("KinematicsError::FootOnYawAxis", axis, words);
    let open = KinematicsError::LoopOpen {
        b2_m: 0.5,
        min_m: 0.1,
        max_m: 0.3,
    };
    let words = vec!["0.5 m", "0.1 and 0.3 m"];
    add("KinematicsError::LoopOpen", open, words);
    let arm = KinematicsError::NoMomentArm {
        cos_theta3: 0.01,
        minimum: 0.05,
    };
    add("KinematicsError::NoMomentArm", arm, vec!["0.01", "0.05"]);
    let stroke = KinematicsError::OutsideStroke {
        cylinder: Cylinder::Vertical,
        length_m: 0.4,
        min_m: 0.0,
        max_m: 0.18,
    };
    let words = vec!["vertical", "0.4 m", "0 to 0.18 m"];
    add("KinematicsError::OutsideStroke", stroke, words);
    let bad = KinematicsError::BadParameter { value: -1.0 };
    add("KinematicsError::BadParameter", bad, vec!["-1"]);
}

fn commands(all: &mut Vec<Reason>) {
    let mut add = |name, error: ParamError, words| {
        let error: Box<dyn Error> = Box::new(error);
        all.push((name, error, words));
    };
    let out_of_range = || OutOfRange {
        argument: &argument::TRAVEL,
        value: Value::Whole(7),
    };
    let words = vec!["`travel`", "7", "allowed: "];
    let range = ParamError::OutOfRange(out_of_range());
    add("ParamError::OutOfRange", range, words.clone());
    let order = ParamError::Order {
        first: &argument::PUSH,
        first_us: 3_000_000,
        then: &argument::PERIOD,
        then_us: 2_500_000,
    };
    let times = vec!["`push`", "3 s", "`period`", "2.5 s", "allowed: "];
    add("ParamError::Order", order, times);
    let push = ParamError::PushTooLong {
        needs_us: 2_000_000,
        has_us: 1_000_000,
    };
    let times = vec!["`period`", "2 s", "1 s", "allowed: "];
    add("ParamError::PushTooLong", push, times);
    let slow = ParamError::TouchdownTooSlow {
        way_mm: PositionMm::from_raw(15 << 16),
        needs_us: 2_000_000,
        has_us: 1_000_000,
    };
    let times = vec!["`touchdown_speed`", "15 mm", "2 s", "1 s", "allowed: "];
    add("ParamError::TouchdownTooSlow", slow, times);
    let endless = ParamError::NotFinite(&argument::TRAVEL);
    let allowed = vec!["`travel`", "allowed: "];
    add("ParamError::NotFinite", endless, allowed.clone());
    let reach = ParamError::OutOfReach { at_ms: 1500 };
    add("ParamError::OutOfReach", reach, vec!["1.5 s", "allowed: "]);
    let counter = ParamError::BeyondCounter {
        limit_mm: PositionMm::from_raw(2 << 16),
    };
    add("ParamError::BeyondCounter", counter, allowed.clone());

    let mut add = |name, error: ArgumentError<'static>, words| {
        let error: Box<dyn Error> = Box::new(error);
        all.push((name, error, words));
    };
    let unknown = ArgumentError::Unknown {
        code: CommandCode::WheelReference,
        name: "distance",
    };
    let words_of = vec!["`distance`", "travel"];
    add("ArgumentError::Unknown", unknown, words_of);
    let twice = ArgumentError::Twice { name: "travel" };
    add("ArgumentError::Twice", twice, vec!["`travel`"]);
    let missing = ArgumentError::Missing(&argument::TRAVEL);
    add("ArgumentError::Missing", missing, allowed.clone());
    let kind = ArgumentError::WrongKind(&argument::TRAVEL);
    add("ArgumentError::WrongKind", kind, allowed);
    let range = ArgumentError::OutOfRange(out_of_range());
    add("ArgumentError::OutOfRange", range, words.clone());
    let relation = ArgumentError::Relation(ParamError::OutOfRange(out_of_range()));
    add("ArgumentError::Relation", relation, words);
}

fn texts(all: &mut Vec<Reason>) {
    let mut fault = |name, text: &'static str, words| {
        let wrong = text.parse::<FaultSpec>().expect_err("no fault");
        assert_eq!(format!("{wrong:?}").split(' ').next(), variant(name));
        let error: Box<dyn Error> = Box::new(wrong);
        all.push((name, error, words));
    };
    let words = vec!["pot-opn", "pot-open", "wheeleg faults list"];
    fault("SpecError::Name", "pot-opn:joint3@1s", words);
    let (missing, reason) = wheeleg_config::faults::NOT_IMPLEMENTED[0];
    let text: &'static str = format!("{missing}@1s").leak();
    fault("SpecError::NotImplemented", text, vec![missing, reason]);
    let words = vec!["pot-open", "wheel7"];
    fault("SpecError::Target", "pot-open:wheel7@1s", words);
    let words = vec!["command-flood=0", "1 to 1000"];
    fault("SpecError::Value", "command-flood=0@1s", words);
    let words = vec!["@3.2s"];
    fault("SpecError::Time", "pot-open:joint3@soon", words);

    let mut case = |name, text: &str, words| {
        let wrong = text.parse::<CaseId>().expect_err("no case");
        let told = format!("{wrong:?}");
        assert_eq!(told.split('(').next(), variant(name));
        let error: Box<dyn Error> = Box::new(wrong);
        all.push((name, error, words));
    };
    case("BadCaseId::Parts", "a/b", vec!["a/b", "AXIS/CONTROLLER"]);
    let words = vec!["`pid`", "predictive"];
    case("BadCaseId::Controller", "a/pid/step-100/nominal/1", words);
    let words = vec!["`jump`", "step-100"];
    case("BadCaseId::Move", "a/predictive/jump/nominal/1", words);
    let words = vec!["`hot`", "nominal"];
    case("BadCaseId::Variation", "a/predictive/step-100/hot/1", words);
    let words = vec!["`-1`", "18446744073709551615"];
    case("BadCaseId::Seed", "a/predictive/step-100/nominal/-1", words);
    let variations = [
        ("UnknownVariation::Name", "hot", "nominal"),
        ("UnknownVariation::Meant", "mass=3", "mass-factor"),
        ("UnknownVariation::Range", "noise=101", "from 0 to 100"),
        ("UnknownVariation::Spelling", "noise=04", "`noise=4`"),
    ];
    for (name, word, told) in variations {
        let unknown: UnknownVariation = word.parse::<Variation>().expect_err("no variation");
        all.push((name, Box::new(unknown), vec![word, told]));
    }
}

/// Name of a variant, without its type.
fn variant(name: &'static str) -> Option<&'static str> {
    name.rsplit("::").next()
}
