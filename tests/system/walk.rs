//! The robot walks: wheels and legs together, on the level, in turns, over rocks.

use crate::behaviours::metrics::drag_of;
use crate::sil;
use wheeleg_config::{Bar, Measure, Motion, Scenario, builtin};
use wheeleg_master::contact::{Sector, Side};
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_master::layer1::walk::{WalkGeometry, WalkOrder};
use wheeleg_protocol::Warning;
use wheeleg_studies::analysis::{Target, analyse};
use wheeleg_telemetry::{Cause, Recording};
use wheeleg_units::VelocityMmS;

/// Results of the scenario's bars for a seed.
fn targets(scenario: &Scenario, seed: u64) -> Vec<Target> {
    let robot = builtin::robot(&scenario.robot).expect("built in");
    let recording = sil::run(scenario, &robot, seed);
    let targets = analyse(scenario, &robot, &recording).targets;
    for t in &targets {
        println!(
            "{} seed {seed}: {} {:?} {}",
            scenario.name, t.id, t.value, t.unit
        );
    }
    targets
}

fn met(scenario: &Scenario, seeds: impl IntoIterator<Item = u64>) {
    for seed in seeds {
        let targets = targets(scenario, seed);
        let missed = targets.iter().filter(|t| t.required && !t.pass);
        let missed: Vec<_> = missed.map(|t| (&t.id, t.value)).collect();
        assert!(
            !targets.is_empty() && missed.is_empty(),
            "seed {seed}: {missed:?}"
        );
    }
}

#[test]
fn the_walk_on_the_level_meets_its_bars() {
    met(&builtin::scenario("walk").expect("built in"), 1..=3);
}

/// Less friction in the cylinders than their boards count on, down to half: the nose hardly bounces on the air of its
/// legs, because the boards of b6 count on the mass of the robot while their feet stand. With that of a leg in the air the
/// feet carry for half of the time.
#[test]
fn a_robot_with_half_the_friction_walks_nearly_as_well() {
    let scenario = builtin::scenario("walk").expect("built in");
    for (seed, share, least) in [(1, 0.5, 90.0), (2, 0.5, 90.0), (3, 0.75, 99.5)] {
        let mut robot = builtin::robot(&scenario.robot).expect("built in");
        for cylinder in &mut robot.plant.cylinders {
            cylinder.friction.coulomb_n *= share;
            cylinder.friction.static_n *= share;
        }
        let recording = sil::run(&scenario, &robot, seed);
        let targets = analyse(&scenario, &robot, &recording).targets;
        let [speed, supported, faults] =
            ["speed", "supported", "faults"].map(|id| sil::value(&targets, id).expect("measured"));
        println!("{share} of the friction: {speed:.1} mm/s, {supported:.2} % supported");
        assert!(supported >= least && speed > 110.0 && faults == 0.0);
    }
}

/// A walk of 20 s with this order, and the bars in SI.
fn walk(order: WalkOrder, bars: &[(Measure, f64, f64)]) -> Scenario {
    let mut scenario = builtin::scenario("walk").expect("built in");
    scenario.duration_s = 20.0;
    scenario.motion = Motion::Walk(order);
    let bar = |(measure, min, max): &(Measure, f64, f64)| Bar {
        measure: *measure,
        min: Some(*min),
        max: Some(*max),
        required: true,
    };
    scenario.bars = bars.iter().map(bar).collect();
    scenario
}

/// A circle of 1.2 m.
fn in_a_circle() -> WalkOrder {
    WalkOrder {
        speed_mm_s: VelocityMmS::from_int(60),
        turn_rad_s: "0.05".parse().expect("a number"),
        ..WalkOrder::default()
    }
}

#[test]
fn a_turn_is_the_one_asked_for() {
    let order = in_a_circle();
    // 20 s at 0.05 rad/s, less the start; the radius is speed over rate of turning.
    let bars = [
        (Measure::Heading, 0.85, 1.02),
        (Measure::Radius, 1.08, 1.32),
        (Measure::ChassisForce, 0.0, 0.0),
    ];
    met(&walk(order, &bars), [1]);
}

#[test]
fn the_robot_walks_backward_and_turns_on_the_spot() {
    let back = WalkOrder {
        speed_mm_s: VelocityMmS::from_int(-80),
        ..WalkOrder::default()
    };
    let bars = [
        (Measure::Speed, -0.082, -0.076),
        (Measure::Heading, -0.03, 0.03),
    ];
    met(&walk(back, &bars), [1]);
    let spin = WalkOrder {
        turn_rad_s: "-0.06".parse().expect("a number"),
        ..WalkOrder::default()
    };
    let bars = [
        (Measure::Heading, -1.25, -0.95),
        (Measure::Distance, -0.05, 0.05),
    ];
    met(&walk(spin, &bars), [1]);
}

/// The master is configured with the leg's dimensions: with those of the paper's leg, the feet would go ahead
/// of the ground in a turn, or lag, and the wheels slip.
#[test]
fn a_robot_with_another_leg_walks_and_turns_as_it_is_told() {
    let mut robot = builtin::robot("wheeleg").expect("built in");
    let plant = &mut robot.plant;
    (plant.body.crank_m, plant.body.p4_m[0], plant.body.o4_m[0]) = (0.232, 0.232, 0.50);
    for leg in [0, 3] {
        plant.stroke_zero_m[leg + 1] = 0.11;
    }
    let order = in_a_circle();
    let bars = [
        (Measure::Heading, 0.85, 1.02),
        (Measure::Radius, 1.08, 1.32),
        (Measure::Slip, -0.02, 0.02),
        (Measure::Faults, 0.0, 0.0),
    ];
    let scenario = walk(order, &bars);
    let recording = sil::run(&scenario, &robot, 1);
    for t in analyse(&scenario, &robot, &recording).targets {
        println!("another leg: {} {:?} {}", t.id, t.value, t.unit);
        assert!(t.pass, "{}: {:?}", t.id, t.value);
    }
    let mut geometry = WalkGeometry {
        hip_x_m: 0.50,
        ..WalkGeometry::default()
    };
    (geometry.leg.crank_m, geometry.leg.p4_m[0]) = (0.232, 0.232);
    geometry.leg.stroke_zero_m[1] = 0.11;
    let drag_mm = drag_of(&recording, &geometry);
    let paper = sil::run(&scenario, &builtin::robot("wheeleg").expect("built in"), 1);
    let paper_mm = drag_of(&paper, &WalkGeometry::default());
    println!("another leg: feet slide {drag_mm:.0} mm, the paper's {paper_mm:.0} mm");
    assert!(drag_mm < 2.0 * paper_mm, "{drag_mm} {paper_mm}");
}

#[test]
fn the_robot_walks_over_rocks() {
    let scenario = builtin::scenario("rocks-20").expect("built in");
    // Of 20 seeds 19 pass, now these and now those: a stone more or less under a wheel decides.
    let passed = (1..=5).filter(|seed| {
        let targets = targets(&scenario, *seed);
        !targets.is_empty() && targets.iter().all(|t| t.pass || !t.required)
    });
    assert!(passed.count() >= 4);
}

/// Nails are out of the sand before a foot moves ahead, and go in before it stands.
#[test]
fn the_robot_walks_on_sand() {
    met(&builtin::scenario("sand-flat").expect("built in"), [1]);
}

/// Ice is ice below wheels, too: on a slope that the robot climbs it slides back although its
/// wheels do not turn back.
#[test]
fn a_robot_whose_wheels_and_feet_slip_slides_down_a_slope() {
    let slides = |fault: &str| {
        let mut scenario = builtin::scenario("slope-10").expect("built in");
        scenario.duration_s = 8.0;
        scenario.bars.clear();
        let fault = (!fault.is_empty()).then(|| fault.parse().expect("a fault"));
        scenario.faults = fault.into_iter().collect();
        let robot = builtin::robot(&scenario.robot).expect("built in");
        let recording = sil::run(&scenario, &robot, 1);
        let rows = sil::window(&recording.body, 5.0, 8.0);
        let body_mm = rows[rows.len() - 1].v.x_mm - rows[0].v.x_mm;
        println!("{fault:?}: {body_mm:.0} mm");
        body_mm
    };
    assert!(slides("") > -1.0, "it stands or climbs");
    // g (sin 10° - 0.05 cos 10°) = 1.2 m/s²: metres in 3 s.
    assert!(slides("foot-slips=0.05@5s") < -500.0);
}

/// A switch told as broken: side of the robot, side of the foot, and how it is broken.
type Broken = (Side, Option<Sector>, Warning);

/// The switches told as broken.
pub(crate) fn broken_switches(scenario: &Scenario, seed: u64) -> Vec<Broken> {
    let robot = builtin::robot(&scenario.robot).expect("built in");
    broken_in(scenario, &sil::run(scenario, &robot, seed))
}

/// The same of a run.
fn broken_in(scenario: &Scenario, recording: &Recording) -> Vec<Broken> {
    let told = recording.events.iter().filter_map(|e| match e.v.cause {
        Cause::Master(MasterEvent::FootSwitch {
            side,
            sector,
            warning,
        }) => {
            println!("{} {}: {}", scenario.name, e.t_ns / 1_000_000, e.v);
            Some((side, sector, warning))
        }
        _ => None,
    });
    told.collect()
}

/// Whether it sticks while the foot stands or while it swings, on the level, in a turn or in front of a wall: a switch
/// that sticks is told, although the leg then hardly moves forward any more.
#[test]
fn a_switch_that_sticks_closed_in_a_walk_is_told() {
    let front = (Side::Left, Some(Sector::Front), Warning::SwitchStuckClosed);
    let rear = (Side::Left, Some(Sector::Rear), Warning::SwitchStuckClosed);
    let outer = (Side::Left, Some(Sector::Left), Warning::SwitchStuckClosed);
    let inner = (Side::Right, Some(Sector::Left), Warning::SwitchStuckClosed);
    let cases = [
        ("walk", 14.0, "foot-switch-on:left.front@6s", front),
        ("walk", 14.0, "foot-switch-on:left.front@7.4s", front),
        ("walk", 14.0, "foot-switch-on:left.back@9s", rear),
        ("walk", 14.0, "foot-switch-on:left.left@6s", outer),
        ("spin", 14.0, "foot-switch-on:left.front@6s", front),
        ("spin", 14.0, "foot-switch-on:right.left@6s", inner),
        ("wall-30", 28.0, "foot-switch-on:left.front@6s", front),
        ("wall-30", 28.0, "foot-switch-on:left.front@14s", front),
    ];
    for (name, duration_s, fault, told) in cases {
        let mut scenario = builtin::scenario(name).expect("built in");
        scenario.duration_s = duration_s;
        scenario.bars.clear();
        scenario.faults = vec![fault.parse().expect("a fault")];
        assert_eq!(broken_switches(&scenario, 1), [told], "{name}, {fault}");
    }
}

/// Once it is told it counts as open: the robot walks on with the other three, where it used to give up, and also when
/// the switch works again.
#[test]
fn a_walk_goes_on_without_a_switch_that_sticks_closed() {
    for (place, sector) in [("front", Sector::Front), ("back", Sector::Rear)] {
        let mut scenario = builtin::scenario("walk").expect("built in");
        scenario.bars.clear();
        scenario.faults = vec![
            format!("foot-switch-on:left.{place}@6s..22s")
                .parse()
                .expect("a fault"),
        ];
        let robot = builtin::robot(&scenario.robot).expect("built in");
        let recording = sil::run(&scenario, &robot, 1);
        let told = (Side::Left, Some(sector), Warning::SwitchStuckClosed);
        assert_eq!(broken_in(&scenario, &recording), [told]);
        let speed_mm_s = |from_s: f64, until_s: f64| {
            let rows = sil::window(&recording.body, from_s, until_s);
            (rows[rows.len() - 1].v.x_mm - rows[0].v.x_mm) / (until_s - from_s)
        };
        let (without, mended) = (speed_mm_s(12.0, 22.0), speed_mm_s(23.0, 29.5));
        println!("{place}: {without:.0} mm/s without the switch, {mended:.0} mm/s with it again");
        assert!(without > 80.0 && mended > 80.0, "{without} {mended}");
    }
}
