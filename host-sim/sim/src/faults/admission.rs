//! Which faults a run can have: one that makes no sense is refused, never silently left out.

use crate::SimError;
use wheeleg_config::faults::{FaultKind, FaultSpec, FaultTarget};
use wheeleg_config::{RobotConfig, Scenario, brief};
use wheeleg_plant::contact::ContactLaw;
use wheeleg_protocol::Node;
use wheeleg_remote_host::{NodeKind, Nodes};

/// Checks the faults of a scenario against its duration, the robot, each other, and
/// where the nodes run.
///
/// # Errors
/// [`SimError::Config`] with the first impossible fault, and why; [`SimError::Simulation`] if that fault is
/// not in the scenario's file.
pub fn check(scenario: &Scenario, robot: &RobotConfig, nodes: &Nodes) -> Result<(), SimError> {
    let mut alone = scenario.faults.iter().enumerate();
    alone
        .try_for_each(|(number, fault)| {
            check_alone(fault, scenario, robot, nodes).map_err(|error| (number, error))
        })
        .and_then(|()| no_rivals(&scenario.faults))
        .map_err(|(number, error)| in_file(scenario, number, error))
}

/// Checks a fault against everything but other faults.
fn check_alone(
    fault: &FaultSpec,
    scenario: &Scenario,
    robot: &RobotConfig,
    nodes: &Nodes,
) -> Result<(), SimError> {
    can_be_there(fault, nodes)?;
    does_something(fault, robot)?;
    if fault.kind.is_built_in() && (fault.from_s > 0.0 || fault.until_s.is_some()) {
        return Err(cannot_begin(fault));
    }
    if fault.from_s >= scenario.duration_s {
        let end_s = scenario.duration_s;
        return Err(SimError::simulation(
            format!(
                "the fault `{fault}` does nothing: scenario `{}` ends at {end_s} s, before it \
                 could begin",
                scenario.name
            ),
            format!("choose a begin from 0 s to below {end_s} s"),
        ));
    }
    let step_s = robot.plant.step_ns as f64 * 1e-9;
    let lasts_s = fault.until_s.map(|until_s| until_s - fault.from_s);
    // To the rounding of the difference.
    if let Some(lasts_s) = lasts_s.filter(|lasts_s| *lasts_s < step_s * (1.0 - 1e-3)) {
        return Err(SimError::simulation(
            format!(
                "the fault `{fault}` does nothing: it lasts {} us, and the robot is computed in steps of {} us",
                brief(lasts_s * 1e6),
                brief(step_s * 1e6)
            ),
            format!(
                "let it last from {} s on, `numerics.step` of the robot {}",
                brief(step_s),
                robot.file
            ),
        ));
    }
    Ok(())
}

/// The error of a fault, with its place if it comes from the scenario's file.
fn in_file(scenario: &Scenario, number: usize, error: SimError) -> SimError {
    let SimError::Simulation { what, help } = &error else {
        return error;
    };
    let refusal = scenario.refuse_fault(number, what, help);
    refusal.map_or(error, |refusal| SimError::Config(Box::new(refusal)))
}

/// Checks a fault that begins now, beside those that are active.
///
/// # Errors
/// [`SimError::Simulation`] with why it cannot be.
pub(crate) fn check_now(
    fault: &FaultSpec,
    active: &[FaultSpec],
    robot: &RobotConfig,
    nodes: &Nodes,
) -> Result<(), SimError> {
    let info = fault.kind.info();
    if !info.place.accepts(fault.target) {
        return Err(SimError::simulation(
            format!(
                "the fault `{}` affects {}",
                info.name,
                info.place.expected()
            ),
            "name such a target",
        ));
    }
    if let Some(value) = info.value.filter(|value| !value.allows(fault.value)) {
        return Err(SimError::simulation(
            format!("the fault `{fault}` has a value outside {}", value.range()),
            "choose a value within that range",
        ));
    }
    if fault.kind.is_built_in() {
        return Err(cannot_begin(fault));
    }
    can_be_there(fault, nodes)?;
    does_something(fault, robot)?;
    for other in active {
        if let Some(part) = contested(fault, other) {
            return Err(SimError::simulation(
                format!(
                    "the fault `{fault}` cannot begin while `{other}` lasts: both act on {part}"
                ),
                "end that one first",
            ));
        }
    }
    Ok(())
}

fn cannot_begin(fault: &FaultSpec) -> SimError {
    SimError::simulation(
        format!("the fault `{fault}` cannot begin or end while the robot runs"),
        format!(
            "this fault is a property of the board: write `{}{}@0s`",
            fault.kind.name(),
            fault.target
        ),
    )
}

/// A fault of a board itself must be possible where that board runs: an image has a clock, a transmitter and
/// an interface of its own; a board on QEMU has no watchdog that would end a stopped program, and a bench
/// board has a supply that nobody here can cut.
fn can_be_there(fault: &FaultSpec, nodes: &Nodes) -> Result<(), SimError> {
    let FaultTarget::Board(node) = fault.target else {
        return Ok(());
    };
    let there = &nodes.0[node.index()];
    use FaultKind as F;
    let (why, elsewhere) = match (there, fault.kind) {
        (NodeKind::Sil, _) => return Ok(()),
        (_, F::ClockDrift | F::Babble | F::BabbleUnguarded | F::OtherInterface) => {
            ("an image brings its own", "`sil`")
        }
        (NodeKind::Pil, _) => return Ok(()),
        (_, F::NodeHang) => (
            "it has no watchdog that would start it again",
            "`sil` or `pil`",
        ),
        (_, F::ProcessorFault) => (
            "a processor fault cannot be provoked there",
            "`sil` or `pil`",
        ),
        (NodeKind::Qemu, _) => return Ok(()),
        // One that falls silent for good can keep its cable.
        (_, F::NodeOff) if fault.until_s.is_none() => return Ok(()),
        (_, F::NodeOff | F::NodeReset | F::BrownOut) => (
            "a bench board is fed by the cable to this computer, whose voltage the \
             simulator cannot switch off",
            "`sil`, `pil` or `qemu`",
        ),
        _ => return Ok(()),
    };
    Err(SimError::simulation(
        format!("the fault `{fault}` cannot act on a board that runs on `{there}`: {why}"),
        format!("let that node run as {elsewhere}"),
    ))
}

/// Checks that a run with boards outside can be compared with one with all boards in this program: not on a
/// disturbed line.
///
/// # Errors
/// [`SimError::Simulation`] with the fault that prevents it.
pub fn ensure_comparable(scenario: &Scenario, nodes: &Nodes) -> Result<(), SimError> {
    use FaultKind as F;
    let on_line = |fault: &&FaultSpec| {
        matches!(
            fault.kind,
            F::BusFull
                | F::BitErrors
                | F::BytesLost
                | F::BytesInserted
                | F::FramesDelayed
                | F::CycleJitter
        )
    };
    match scenario.faults.iter().find(on_line) {
        Some(fault) if !nodes.all_native() => Err(SimError::simulation(
            format!(
                "with the fault `{fault}`, boards outside of this program may differ from \
                 its own: the native boards receive whole frames, the remote ones single bytes"
            ),
            "omit --compare-sil; the run then reports where boards differ at their pins",
        )),
        _ => Ok(()),
    }
}

/// Refuses a fault that would not change this robot.
fn does_something(fault: &FaultSpec, robot: &RobotConfig) -> Result<(), SimError> {
    let plant = &robot.plant;
    let (what, unit, sound) = match fault.kind {
        FaultKind::SupplySag => {
            let supply_pa = plant.supply.source_pressure_pa - plant.gas.ambient_pressure_pa;
            ("source pressure", " bar", supply_pa * 1e-5)
        }
        FaultKind::FootSlips => {
            let laws = [&plant.contacts.foot.law, &plant.contacts.wheel.law];
            let largest = |law: &ContactLaw| law.mu_static.max(law.mu_kinetic);
            (
                "coefficient of friction",
                "",
                laws.map(largest).into_iter().fold(0.0, f64::max),
            )
        }
        _ => return Ok(()),
    };
    if fault.value < sound {
        return Ok(());
    }
    Err(SimError::simulation(
        format!("the fault `{fault}` does nothing: the {what} of the robot is {sound:.2}{unit}"),
        "choose a value below that",
    ))
}

/// Parts of the robot, each with its place, that a fault takes for itself as long as it lasts: either the
/// simulation keeps one fault of such a part, and its end restores the sound part; or two faults exclude each
/// other, as an open wiper and one that jumps.
fn parts(fault: &FaultSpec) -> Vec<(&'static str, FaultTarget)> {
    use FaultKind as F;
    let part = match fault.kind {
        F::MasterSilent | F::MasterFrozen => "transmitter of the master",
        F::NodeSilent | F::Babble | F::BabbleUnguarded => "transmitter",
        F::NodeOff | F::NodeReset | F::BrownOut | F::NodeHang | F::ProcessorFault => {
            "power and program"
        }
        F::PotOpen | F::PotShort | F::PotFrozen | F::PotNoisy => "potentiometer",
        F::SwitchStuckOn | F::SwitchStuckOff => "foot switch",
        F::EncoderLost | F::EncoderReversed => "encoder",
        F::ValveStuckOpen | F::ValveStuckShut | F::ValveSlow => "valve",
        F::ValveLeak => "cylinder",
        F::SupplySag | F::SupplyLost => "air source",
        F::InvalidParameter => return vec![("service tool", FaultTarget::Robot)],
        _ => return Vec::new(),
    };
    let mut parts = vec![(part, fault.target)];
    if let (F::ValveSlow, FaultTarget::Valve(joint, _)) = (fault.kind, fault.target) {
        parts.push(("cylinder", FaultTarget::Board(Node::JOINTS[joint])));
    }
    parts
}

/// The part that two faults cannot both act on at a time, in words.
fn contested(a: &FaultSpec, b: &FaultSpec) -> Option<String> {
    let others = parts(b);
    let of = |place: FaultTarget| place.to_string().trim_start_matches(':').to_owned();
    if let Some((part, place)) = parts(a).into_iter().find(|part| others.contains(part)) {
        return Some(match place {
            FaultTarget::Robot => format!("the {part}"),
            _ => format!("the {part} of {}", of(place)),
        });
    }
    // Faults that combine with every other kind: one of a kind at a time.
    (a.kind == b.kind && a.target == b.target).then(|| match a.target {
        FaultTarget::Robot => whole(a.kind).to_owned(),
        place => of(place),
    })
}

/// The part that a fault affects and that exists only once.
fn whole(kind: FaultKind) -> &'static str {
    use FaultKind as F;
    match kind {
        F::BusFull | F::BitErrors | F::BytesLost | F::BytesInserted | F::FramesDelayed => {
            "the line"
        }
        F::MasterReset | F::LayerOneStall | F::CommandFlood | F::CycleJitter => "the master",
        F::ClientReset => "the user's program",
        F::TubeBurst => "the air supply",
        F::FootLosesContact | F::FootSinks | F::FootSlips => "the ground",
        F::DiskFull => "the recorder",
        _ => "the robot",
    }
}

/// Two faults of one part at a time: the end of one would undo the other. The same fault
/// at the same place twice at a time has no meaning. The error has the number of the later one in the list.
fn no_rivals(faults: &[FaultSpec]) -> Result<(), (usize, SimError)> {
    let mut by_begin: Vec<usize> = (0..faults.len()).collect();
    by_begin.sort_by(|a, b| faults[*a].from_s.total_cmp(&faults[*b].from_s));
    // Faults under way are at different parts, of which a robot has few.
    let mut under_way: Vec<usize> = Vec::new();
    for new in by_begin {
        let begins = &faults[new];
        under_way.retain(|at| faults[*at].over_s() > begins.from_s);
        for old in &under_way {
            let lasts = &faults[*old];
            if lasts.from_s >= begins.over_s() {
                continue;
            }
            let Some(part) = contested(lasts, begins) else {
                continue;
            };
            let later = new.max(*old);
            let [a, b] = [new.min(*old), later].map(|at| &faults[at]);
            let from_s = begins.from_s;
            let error = SimError::simulation(
                format!(
                    "the faults `{a}` and `{b}` overlap on {part} from {from_s} s on, where they \
                     cannot be combined"
                ),
                "leave one of them out, or end the first before the second begins",
            );
            return Err((later, error));
        }
        under_way.push(new);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    /// Admits faults to a run of the built-in robot with these nodes.
    fn admitted(faults: &[&str], nodes: &Nodes) -> Result<(), SimError> {
        let mut scenario = builtin::scenario("three-step").expect("built in");
        let robot = builtin::robot(&scenario.robot).expect("built in");
        scenario.faults = faults.iter().map(|f| f.parse().expect(f)).collect();
        check(&scenario, &robot, nodes)
    }

    /// Faults that follow each other are compared only with those under way.
    #[test]
    fn a_hundred_thousand_faults_are_admitted_in_a_moment() {
        let mut scenario = builtin::scenario("stand").expect("built in");
        let robot = builtin::robot(&scenario.robot).expect("built in");
        scenario.duration_s = 10_000.0;
        let fault = |i: u32| {
            let (joint, at_s) = (1 + i % 6, 0.05 * f64::from(i));
            let text = format!("pot-open:joint{joint}@{at_s}s..{}s", at_s + 0.2);
            text.parse().expect("a fault")
        };
        scenario.faults = (0..100_000).rev().map(fault).collect();
        let begun = std::time::Instant::now();
        assert!(check(&scenario, &robot, &Nodes::default()).is_ok());
        scenario.faults.push(fault(7));
        assert!(check(&scenario, &robot, &Nodes::default()).is_err());
        let seconds = begun.elapsed().as_secs_f64();
        assert!(seconds < 5.0, "{seconds} s");
    }

    /// A fault that ends before the next step of the plant could not act.
    #[test]
    fn a_fault_that_is_shorter_than_a_step_is_refused() {
        let nodes = Nodes::default();
        for fault in [
            "bit-errors=0.1@0s..0.000001s",
            "pot-frozen:joint3@1.4999s..1.49991s",
        ] {
            let error = admitted(&[fault], &nodes).expect_err(fault).to_string();
            assert!(error.contains("does nothing: it lasts 1"), "{error}");
            assert!(error.contains("steps of 100 us"), "{error}");
        }
        for fault in [
            "bit-errors=0.1@0s..0.0001s",
            "pot-frozen:joint3@1.4999s..1.5s",
        ] {
            admitted(&[fault], &nodes).expect(fault);
        }
    }

    #[test]
    fn faults_of_one_part_at_a_time_are_refused_with_both_names() {
        for (a, b, part) in [
            (
                "valve-slow:joint3.fill-a=8@1s",
                "valve-leak:joint3=10000@1.1s..1.2s",
                "cylinder of joint3",
            ),
            (
                "valve-slow:joint3.fill-a=8@1s",
                "valve-slow:joint3.vent-b=2@1.1s..1.2s",
                "cylinder of joint3",
            ),
            (
                "valve-stuck-shut:joint3.fill-a@1s",
                "valve-stuck-open:joint3.fill-a@0.9s..1.001s",
                "valve of joint3.fill-a",
            ),
            (
                "valve-stuck-shut:joint3.fill-a@1s",
                "valve-slow:joint3.fill-a=2@1s",
                "valve of joint3.fill-a",
            ),
            (
                "pot-open:joint2@1s",
                "pot-short:joint2@0s..2s",
                "potentiometer of joint2",
            ),
            (
                "pot-frozen:joint2@1s",
                "pot-noisy:joint2=5@2s",
                "potentiometer of joint2",
            ),
            (
                "foot-switch-on:left.back@1s",
                "foot-switch-off:left.back@1s",
                "foot switch of left.back",
            ),
            (
                "encoder-lost:wheel7@1s",
                "encoder-reversed:wheel7@2s",
                "encoder of wheel7",
            ),
            ("supply-sag=3@1s", "supply-lost@2s..3s", "the air source"),
            (
                "master-silent@1s",
                "master-frozen@2s..3s",
                "transmitter of the master",
            ),
            (
                "node-silent:joint1@1s",
                "babble:joint1@1s",
                "transmitter of joint1",
            ),
            (
                "node-off:joint1@1s",
                "node-reset:joint1@2s",
                "power and program of joint1",
            ),
            (
                "node-hang:joint1@1s",
                "brown-out:joint1=30@1.049s",
                "power and program of joint1",
            ),
            (
                "brown-out:joint1=30@1s",
                "node-reset:joint1@1.029s",
                "power and program of joint1",
            ),
            (
                "invalid-parameter:joint1@1s",
                "invalid-parameter:wheel7@1.1s",
                "the service tool",
            ),
            ("supply-lost@1s", "supply-lost@2s", "the air source"),
            (
                "brown-out:joint1=30@1s",
                "brown-out:joint1=40@1.02s",
                "program of joint1 from 1.02 s on",
            ),
            (
                "bit-errors=0.0001@1s",
                "bit-errors=0.001@0.5s..1.5s",
                "the line from 1 s on",
            ),
            (
                "load-step:joint2=5@1s",
                "load-step:joint2=60@2s",
                "on joint2 from 2 s on",
            ),
            ("disk-full@1s", "disk-full@1s..2s", "the recorder"),
        ] {
            for pair in [[a, b], [b, a]] {
                let refusal = admitted(&pair, &Nodes::default()).expect_err(a).to_string();
                // Both as they are given, so that values and times tell them apart.
                for fault in pair {
                    assert!(refusal.contains(&format!("`{fault}`")), "{refusal}");
                }
                assert!(
                    refusal.contains("overlap on") && refusal.contains(part),
                    "{refusal}"
                );
            }
        }
    }

    /// A fault of the file is named with its line, an added one by itself.
    #[test]
    fn a_fault_of_the_file_is_refused_at_its_place() {
        const TEXT: &str = "name = \"x\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"2 s\"\n\
            seed = 1\ntargets = \"none\"\nfaults = [\n\"pot-open:joint3@0.2s\",\n\
            \"pot-open:joint3@0.4s\",\n]\n[motion]\nkind = \"stand\"\n";
        let mut scenario = Scenario::parse("my.toml", TEXT).expect("sound");
        let robot = builtin::robot("wheeleg").expect("built in");
        let refused =
            |scenario: &Scenario| check(scenario, &robot, &Nodes::default()).expect_err("rivals");
        let SimError::Config(refusal) = refused(&scenario) else {
            panic!("an error of the file");
        };
        let said = refusal.problems()[0].summary();
        assert!(said.starts_with("my.toml:9: `faults[1]`: "), "{said}");
        assert!(said.contains("overlap on the potentiometer"), "{said}");
        scenario.faults[1] = "pot-open:joint2@0.2s".parse().expect("a fault");
        scenario.faults.push(scenario.faults[0]);
        let added = refused(&scenario);
        assert!(matches!(added, SimError::Simulation { .. }), "{added:?}");
    }

    #[test]
    fn faults_one_after_the_other_or_of_different_parts_stay() {
        for pair in [
            [
                "valve-slow:joint3.fill-a=8@1s..2s",
                "valve-leak:joint3=10000@2s..3s",
            ],
            [
                "valve-slow:joint3.fill-a=8@1s",
                "valve-leak:joint2=10000@1s",
            ],
            [
                "valve-stuck-open:joint3.fill-a@1s",
                "valve-stuck-shut:joint3.vent-a@1s",
            ],
            [
                "valve-stuck-open:joint3.fill-a@1s",
                "valve-leak:joint3=100@1s..2s",
            ],
            ["pot-open:joint2@1s..2s", "pot-open:joint2@2s..3s"],
            ["pot-open:joint2@1s", "pot-short:joint3@1s"],
            ["encoder-lost:wheel7@1s", "encoder-reversed:wheel8@1s"],
            ["encoder-lost:wheel7@1s", "node-silent:wheel7@2s..3s"],
            ["supply-sag=3@1s", "tube-burst@2s"],
            ["foot-slips=0.05@1s", "foot-loses-contact=0.03@2s..3s"],
            ["foot-sinks=0.05@1s", "foot-loses-contact=0.03@2s..3s"],
            ["bit-errors=1e-4@1s", "bytes-lost=1e-3@1s..2s"],
            ["node-hang:joint1@1s", "brown-out:joint1=30@1.05s"],
            ["brown-out:joint1=30@1s", "brown-out:joint1=30@2s"],
            ["node-silent:joint1@1s", "node-reset:joint1@2s"],
            ["invalid-parameter:joint1@1s", "invalid-parameter:wheel7@2s"],
        ] {
            let outcome = admitted(&pair, &Nodes::default());
            assert!(outcome.is_ok(), "{pair:?}: {outcome:?}");
        }
    }

    #[test]
    fn a_fault_that_begins_when_all_is_over_is_refused_with_the_end() {
        for fault in ["supply-lost@10s", "supply-lost@10s..11s", "supply-lost@12s"] {
            let refusal = admitted(&[fault], &Nodes::default()).expect_err(fault);
            let words = "scenario `three-step` ends at 10 s";
            assert!(refusal.to_string().contains(words), "{refusal}");
        }
        for fault in ["supply-lost@9.999s", "supply-lost@9s..11s"] {
            let outcome = admitted(&[fault], &Nodes::default());
            assert!(outcome.is_ok(), "{fault}: {outcome:?}");
        }
    }

    #[test]
    fn what_leaves_this_robot_as_it_is_is_refused() {
        let mut scenario = builtin::scenario("three-step").expect("built in");
        let mut robot = builtin::robot(&scenario.robot).expect("built in");
        robot.plant.supply.source_pressure_pa = 8e5 + robot.plant.gas.ambient_pressure_pa;
        let mut outcome = |fault: &str| {
            scenario.faults = vec![fault.parse().expect("a fault")];
            check(&scenario, &robot, &Nodes::default())
        };
        for (fault, words) in [
            (
                "supply-sag=8@1s",
                "source pressure of the robot is 8.00 bar",
            ),
            (
                "supply-sag=9.9@1s",
                "source pressure of the robot is 8.00 bar",
            ),
            ("foot-slips=0.8@1s", "friction of the robot is 0.80"),
        ] {
            let refusal = outcome(fault).expect_err(fault).to_string();
            assert!(refusal.contains(words), "{refusal}");
        }
        assert!(outcome("supply-sag=7.9@1s").is_ok());
        assert!(outcome("foot-slips=0.75@1s").is_ok());
    }

    #[test]
    fn what_a_board_cannot_suffer_where_it_runs_is_refused() {
        let admitted = |fault: &str, there: &str| {
            let choice = there.parse().expect("a choice");
            let nodes = Nodes::new(&NodeKind::Sil, &[choice]).expect("one choice");
            admitted(&[fault], &nodes)
        };
        let power = [
            "brown-out:joint3@1s",
            "node-reset:joint3@1s",
            "node-off:joint3@1s..2s",
            "node-off:joint3@1s",
        ];
        let hang = ["node-hang:joint3@1s"];
        let own = ["clock-drift:joint3=200@1s", "babble:joint3@1s"];
        let all = || power.iter().chain(&hang).chain(&own);
        for (there, possible, why) in [
            ("joint3=pil", [&power[..], &hang].concat(), "its own"),
            ("joint3=qemu", power.to_vec(), "no watchdog"),
            (
                "joint3=hil:/dev/ttyACM0",
                vec!["node-off:joint3@1s"],
                "cable to this computer",
            ),
        ] {
            let mut refusals = String::new();
            for fault in all() {
                let outcome = admitted(fault, there);
                if possible.contains(fault) {
                    assert!(outcome.is_ok(), "{fault} {there}");
                    continue;
                }
                let refusal = outcome.expect_err(fault).to_string();
                for part in [fault.split([':', '@']).next(), there.split('=').nth(1)] {
                    assert!(refusal.contains(part.expect("a part")), "{refusal}");
                }
                refusals.push_str(&refusal);
            }
            assert!(refusals.contains(why), "{refusals}");
            assert!(admitted("pot-open:joint3@1s", there).is_ok());
        }
        for fault in all() {
            assert!(admitted(fault, "joint4=qemu").is_ok(), "{fault}");
        }
    }
    #[test]
    fn on_a_disturbed_line_boards_outside_are_not_asked_to_equal_those_here() {
        let comparable = |fault: &str, choices: &[&str]| {
            let mut scenario = builtin::scenario("three-step").expect("built in");
            scenario.faults = vec![fault.parse().expect("a fault")];
            let choices: Vec<_> = choices.iter().map(|c| c.parse().expect("one")).collect();
            let nodes = Nodes::new(&NodeKind::Sil, &choices).expect("choices");
            ensure_comparable(&scenario, &nodes)
        };
        for fault in [
            "bus-full@1s",
            "bit-errors=1e-4@1s..4s",
            "bytes-lost@1s",
            "bytes-inserted@1s",
            "frames-delayed=15@1s",
            "cycle-jitter@1s",
        ] {
            let refusal = comparable(fault, &["joint3=pil"]).expect_err(fault);
            let name = fault.split(['@', '=']).next().expect("a name");
            assert!(refusal.to_string().contains(name), "{refusal}");
            assert!(comparable(fault, &[]).is_ok(), "all in this program");
        }
        assert!(comparable("brown-out:joint3@1s", &["joint3=pil"]).is_ok());
        assert!(comparable("master-silent@1s", &["joint3=pil"]).is_ok());
    }
}
