//! The table: every row of the fault matrix (host-sim/FAULTS.md).

use super::expected::Expected::{
    self, AnyLost, ChecksumErrors, Done, Duplicate, FloodRefused, FootSwitch, Found, FoundAt, Hold,
    Latched, LatchedBy, LatchedOneOf, Lost, MessagesLost, OtherInterface, Parameter, Refused,
    SaysFault, SaysReset, ServiceRefused, ServiceUnchanged,
};
use super::row::{
    Ask, Connection, Expect, FOR_GOOD, Phase, Row, RowFault, Variant, at, missing, row, stop,
    stop_axis, stop_moving,
};
use wheeleg_master::command::{CommandCode, Layer};
use wheeleg_master::contact::{Sector, Side};
use wheeleg_master::event::HoldReason;
use wheeleg_master::finding::Finding;
use wheeleg_protocol::{Fault, NackReason, ResetCause, Warning};
use wheeleg_telemetry::event::BadRequest;

/// Watchdog of 50 ms and one bus cycle; not before the watchdog time less the cycle heard last.
const LINK_MS: [f64; 2] = [38.0, 60.0];
/// Valves shut, or wheel ramp begun, after loss of the link, ms.
const LINK_SHUT_MS: f64 = 60.0;
/// Three missed replies in a row: known at the start of the next cycle.
const ABSENT_MS: [f64; 2] = [19.0, 41.0];
/// Then the others are commanded to brake, one after the other, ms.
const ABSENT_SHUT_MS: f64 = 60.0;
/// Two ticks of the board, and the tick in which the fault begins.
const SENSOR_MS: [f64; 2] = [0.9, 3.1];
/// A board stops in the tick in which it sees the fault, ms.
const SENSOR_SHUT_MS: f64 = 4.1;
/// The next reply reports it to the master, and the next cycle commands the others to brake, ms.
const OTHERS_MS: f64 = 35.0;
/// Two bus cycles and a tick: every board has heard the E-stop, ms.
const ESTOP_MS: f64 = 23.0;

/// The operator was last heard up to 65 ms before the line fails, counts as gone 400 ms after that, and is
/// missed at the next cycle.
const OPERATOR_MS: [f64; 2] = [330.0, 420.0];
/// All boards have heard of it, ms.
const OPERATOR_SHUT_MS: f64 = 460.0;
const OPERATOR_GONE: &[Expected] = &[Hold(HoldReason::OperatorLost)];

/// A user changes a parameter, stores it, and reads it later.
const SAVE: [(f64, Ask); 5] = [
    (-0.3, Ask::Disarm),
    (-0.2, Ask::Read(3, FOLLOWING)),
    (-0.1, Ask::Write(3, FOLLOWING, 55.0)),
    (0.0, Ask::Save(3)),
    (0.8, Ask::Read(3, FOLLOWING)),
];
/// A fault that outlasts its detection and ends before arming is requested: if that is then refused, it is
/// because the fault is latched.
const LONG_S: f64 = 1.2;
/// The same in the longer runs.
const LONGER_S: f64 = 2.7;
const FOLLOWING: &str = "following_error";

/// Faults by which a board reports that its axis does not follow.
const STUCK: &[Fault] = &[Fault::NoMotion, Fault::FollowingError];
const LEFT_FRONT_CLOSED: Expected =
    FootSwitch(Side::Left, Sector::Front, Warning::SwitchStuckClosed);
const LEFT_REAR_OPEN: Expected = FootSwitch(Side::Left, Sector::Rear, Warning::SwitchStuckOpen);
/// A parameter that no board has.
const NO_PARAMETER: u16 = 0x7FFF;

const fn later(what: &'static str, after_s: f64, lasts_s: f64) -> RowFault {
    RowFault {
        what,
        after_s,
        lasts_s,
    }
}

/// A board refuses all requests of a service tool, and changes nothing.
const fn refusals(board: u8) -> [Expected; 4] {
    [
        ServiceRefused(board, BadRequest::AboveLimit, NackReason::OutOfRange),
        ServiceRefused(
            board,
            BadRequest::UnknownParameter(NO_PARAMETER),
            NackReason::UnknownParameter,
        ),
        ServiceRefused(board, BadRequest::NotANumber, NackReason::BadLength),
        ServiceUnchanged(board),
    ]
}

const fn goes_on(deviation_mm: f64) -> Expect {
    Expect::GoesOn { deviation_mm }
}

/// Every row, in the order of the matrix.
#[rustfmt::skip]
pub const ROWS: &[Row] = &[
    // Master stops sending.
    row("master-silent/flight", &[at("master-silent", 0.2)], Phase::Flight,
        stop(LINK_MS, LINK_SHUT_MS), &[Latched(Fault::LinkLost)]),
    row("master-silent/push", &[at("master-silent", 0.2)], Phase::Push,
        stop(LINK_MS, LINK_SHUT_MS), &[Latched(Fault::LinkLost)]),
    row("master-silent/lowering", &[at("master-silent", LONG_S)], Phase::BeforeLower,
        stop(LINK_MS, LINK_SHUT_MS), &[Latched(Fault::LinkLost)]),
    // Its counter is frozen.
    row("master-frozen/flight", &[at("master-frozen", 0.2)], Phase::Flight,
        stop(LINK_MS, LINK_SHUT_MS), &[Latched(Fault::StaleMaster)]),
    row("master-frozen/push", &[at("master-frozen", 0.2)], Phase::Push,
        stop(LINK_MS, LINK_SHUT_MS), &[Latched(Fault::StaleMaster)]),
    // One node silent, reset, babbling, with the address of another.
    row("node-silent/joint", &[at("node-silent:joint3", 0.3)], Phase::Flight,
        stop(ABSENT_MS, ABSENT_SHUT_MS), &[Lost(3), Hold(HoldReason::NodeLost(3))]).answering(7),
    row("node-silent/wheel", &[at("node-silent:wheel7", 0.3)], Phase::Push,
        stop(ABSENT_MS, ABSENT_SHUT_MS), &[Lost(7)]).answering(7),
    row("node-off/joint", &[at("node-off:joint2", LONG_S)], Phase::Push,
        stop_axis(2, ABSENT_MS, 1.1, ABSENT_SHUT_MS), &[Lost(2)]).answering(7),
    row("node-off/wheel", &[at("node-off:wheel8", LONG_S)], Phase::Push,
        stop_axis(8, ABSENT_MS, 1.1, ABSENT_SHUT_MS), &[Lost(8)]).answering(7),
    row("node-reset/joint", &[at("node-reset:joint3", FOR_GOOD)], Phase::Flight,
        stop_axis(3, [0.0, 41.0], 1.1, ABSENT_SHUT_MS), &[SaysReset(3, ResetCause::PowerUp)]),
    row("babble/guarded", &[at("babble:joint5", 0.3)], Phase::Push,
        stop_axis(5, [0.0, 12.0], 13.0, ABSENT_SHUT_MS),
        &[Lost(5), FoundAt(5, Finding::SlotBabble), SaysFault(5, Fault::SlotOverrun)]).answering(7)
        .noted("the other seven boards' slots are unaffected; the board that is cut off stops on its own"),
    row("babble/unguarded", &[at("babble-unguarded:joint5", 0.3)], Phase::Push,
        stop([9.0, 60.0], LINK_SHUT_MS),
        &[Found(Finding::BusBabble), FoundAt(5, Finding::Babbler)]),
    row("duplicate-address/joint", &[at("duplicate-address:joint4", LONG_S)], Phase::Push,
        stop(ABSENT_MS, ABSENT_SHUT_MS), &[Duplicate(4)])
        .noted("a board that is plugged in stays silent during its self-test; its first reply collides after that"),
    row("duplicate-address/wheel", &[at("duplicate-address:wheel8", LONG_S)], Phase::Push,
        stop(ABSENT_MS, ABSENT_SHUT_MS), &[Duplicate(8)])
        .noted("as above"),
    row("e-stop/walking", &[], Phase::Flight,
        stop([0.0, ESTOP_MS], ESTOP_MS), &[Hold(HoldReason::EmergencyStop)]).with_estop(),
    row("e-stop/bus-full", &[at("bus-full", LONG_S)], Phase::Push,
        stop([0.0, ESTOP_MS], ESTOP_MS),
        &[Hold(HoldReason::EmergencyStop), Latched(Fault::EmergencyStop), FoundAt(8, Finding::LineFull)]).with_estop()
        .noted("the line is loaded to more than 95 %"),
    // The line.
    row("bit-errors/1e-6", &[at("bit-errors=1e-6", FOR_GOOD)], Phase::Flight, goes_on(10.0), &[]),
    row("bit-errors/1e-5", &[at("bit-errors=1e-5", FOR_GOOD)], Phase::Flight, goes_on(10.0), &[]),
    row("bit-errors/1e-4", &[at("bit-errors=1e-4", LONG_S)], Phase::Flight, Expect::Degrades, &[ChecksumErrors]),
    row("bit-errors/1e-3", &[at("bit-errors=1e-3", LONG_S)], Phase::Flight,
        stop([0.0, 200.0], 260.0), &[ChecksumErrors, AnyLost]),
    row("bit-errors/60s", &[at("bit-errors=1e-4", 60.0)], Phase::Start, Expect::Degrades, &[ChecksumErrors])
        .of(Variant::Long).lasting(60.8),
    row("bytes-lost", &[at("bytes-lost=1e-3", LONG_S)], Phase::Flight, Expect::Degrades, &[ChecksumErrors]),
    row("bytes-inserted", &[at("bytes-inserted=1e-3", LONG_S)], Phase::Flight, Expect::Degrades, &[ChecksumErrors]),
    row("frames-delayed/15us", &[at("frames-delayed=15", FOR_GOOD)], Phase::Flight, goes_on(10.0), &[]),
    row("frames-delayed/500us", &[at("frames-delayed=500", LONG_S)], Phase::Flight,
        stop([0.0, 200.0], 260.0), &[ChecksumErrors, AnyLost]),
    // Potentiometer.
    row("pot-open", &[at("pot-open:joint3", 0.3)], Phase::Flight,
        stop_axis(3, SENSOR_MS, SENSOR_SHUT_MS, OTHERS_MS), &[LatchedBy(3, Fault::SensorRange)]),
    row("pot-short", &[at("pot-short:joint2", 0.3)], Phase::Push,
        stop_axis(2, SENSOR_MS, SENSOR_SHUT_MS, OTHERS_MS), &[LatchedBy(2, Fault::SensorRange)]),
    row("pot-noisy", &[at("pot-noisy:joint3=10", 0.3)], Phase::Flight,
        stop_axis(3, [0.9, 20.0], 21.0, 55.0), &[LatchedBy(3, Fault::SensorRate)]),
    row("pot-frozen/lowering", &[at("pot-frozen:joint3", LONG_S)], Phase::SecondLower,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]),
    row("pot-frozen/reach", &[at("pot-frozen:joint2", LONG_S)], Phase::BeforeReach,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]),
    row("pot-frozen/first-lowering", &[at("pot-frozen:joint3", LONGER_S)], Phase::BeforeLower,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]).lasting(3.5),
    row("pot-frozen/first-reach", &[at("pot-frozen:joint2", LONGER_S)], Phase::FirstReach,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]).lasting(3.5),
    // Foot switches.
    row("foot-switch-on", &[at("foot-switch-on:left.front", FOR_GOOD)], Phase::Flight,
        goes_on(0.001), &[LEFT_FRONT_CLOSED]).lasting(9.0),
    row("foot-switch-off", &[at("foot-switch-off:left.back", FOR_GOOD)], Phase::Flight,
        goes_on(0.001), &[LEFT_REAR_OPEN]).lasting(9.0),
    row("foot-switch-on/reflex", &[at("foot-switch-on:left.front", FOR_GOOD)], Phase::Flight,
        goes_on(10.0), &[LEFT_FRONT_CLOSED]).of(Variant::Reflex).lasting(9.0)
        .noted("the reflex stops the lowering where it takes the ground to be: the foot stays higher than it should"),
    row("foot-switch-off/reflex", &[at("foot-switch-off:left.back", FOR_GOOD)], Phase::Flight,
        goes_on(0.001), &[LEFT_REAR_OPEN]).of(Variant::Reflex).lasting(9.0),
    // Encoder.
    row("encoder-lost", &[at("encoder-lost:wheel7", LONG_S)], Phase::Push,
        stop_axis(7, [0.0, 100.0], 103.0, 140.0), &[LatchedBy(7, Fault::EncoderFault)]),
    row("encoder-reversed", &[at("encoder-reversed:wheel8", LONG_S)], Phase::Push,
        stop_axis(8, [0.0, 100.0], 103.0, 140.0), &[LatchedBy(8, Fault::EncoderFault)]),
    // Valves.
    row("valve-stuck-shut/fill", &[at("valve-stuck-shut:joint3.fill-a", LONG_S)], Phase::SecondLower,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]),
    row("valve-stuck-shut/vent", &[at("valve-stuck-shut:joint2.vent-b", LONG_S)], Phase::BeforeReach,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]),
    row("valve-stuck-shut/first-fill", &[at("valve-stuck-shut:joint3.fill-a", LONGER_S)], Phase::BeforeLower,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]).lasting(3.5),
    row("valve-stuck-shut/first-vent", &[at("valve-stuck-shut:joint2.vent-b", LONGER_S)], Phase::FirstReach,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]).lasting(3.5),
    row("valve-stuck-open/fill", &[at("valve-stuck-open:joint3.fill-a", LONG_S)], Phase::BeforeLift,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]).holding(3.0)
        .noted("the foot stands near the end of its stroke; host-sim/FAULTS.md says how far an axis runs in mid-stroke"),
    row("valve-stuck-open/vent", &[at("valve-stuck-open:joint2.vent-a", LONG_S)], Phase::BeforeReach,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]).holding(10.0),
    row("valve-stuck-open/first-vent", &[at("valve-stuck-open:joint2.vent-a", LONGER_S)], Phase::FirstReach,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]).lasting(3.5),
    row("valve-stuck-open/rest", &[at("valve-stuck-open:joint2.fill-a", LONGER_S)], Phase::Stand,
        stop_moving(2), &[LatchedOneOf(2, STUCK)]).lasting(3.5),
    row("valve-slow", &[at("valve-slow:joint3.fill-a=8", LONG_S)], Phase::SecondLower,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]),
    row("valve-leaking", &[at("valve-leak:joint3=10000", LONG_S)], Phase::SecondLower,
        stop_moving(3), &[LatchedOneOf(3, STUCK)]),
    // Supply.
    row("supply-sag", &[at("supply-sag=2", LONG_S)], Phase::Flight,
        stop([0.0, 100.0], 140.0), &[Hold(HoldReason::SupplyLost)])
        .noted("the contact before the regulator opens at 6.8 bar gauge"),
    row("supply-lost", &[at("supply-lost", LONG_S)], Phase::Flight,
        stop([0.0, 100.0], 140.0), &[Hold(HoldReason::SupplyLost)])
        .noted("the contact before the regulator opens at 6.8 bar gauge"),
    row("tube-burst", &[at("tube-burst", LONG_S)], Phase::Flight,
        stop([0.0, 100.0], 140.0), &[Hold(HoldReason::SupplyLost)])
        .noted("the contact at the reservoir opens at 5.4 bar gauge"),
    // Load and ground.
    row("load-step", &[at("load-step:joint3=60", 0.5)], Phase::Flight, goes_on(60.0), &[]),
    row("foot-loses-contact", &[at("foot-loses-contact=0.03", FOR_GOOD)], Phase::Push, goes_on(40.0), &[]),
    row("foot-slips", &[at("foot-slips=0.05", FOR_GOOD)], Phase::Push, goes_on(40.0), &[]),
    row("foot-sinks", &[at("foot-sinks=0.03", FOR_GOOD)], Phase::Push, goes_on(40.0), &[]),
    // Brown-out.
    row("brown-out/motion", &[at("brown-out:joint2=30", FOR_GOOD)], Phase::Push,
        stop_axis(2, [0.0, 41.0], 1.1, ABSENT_SHUT_MS), &[Lost(2), SaysReset(2, ResetCause::PowerUp)]),
    row("brown-out/supply-board", &[at("brown-out:wheel7=30", FOR_GOOD)], Phase::Push,
        stop_axis(7, [0.0, 41.0], 1.1, ABSENT_SHUT_MS), &[Lost(7), SaysReset(7, ResetCause::PowerUp)]),
    row("brown-out/save", &[later("brown-out:joint3=30", 0.02, FOR_GOOD)], Phase::Stand,
        Expect::Restarts { board: 3 },
        &[Refused(CommandCode::SaveParameters, 3), SaysReset(3, ResetCause::PowerUp), Parameter(3, FOLLOWING, 60.0)])
        .asking(&SAVE)
        .noted("the power fails while the page for the new set is erased; the tests of the store, of `sil` and of the emulated board cover every other instant of a save"),
    row("brown-out/saved", &[later("brown-out:joint3=30", 0.3, FOR_GOOD)], Phase::Stand,
        Expect::Restarts { board: 3 },
        &[Done(CommandCode::SaveParameters), SaysReset(3, ResetCause::PowerUp), Parameter(3, FOLLOWING, 55.0)])
        .asking(&SAVE)
        .noted("the power fails once the parameters are stored: the new set is in force"),
    missing("brown-out/update"),
    // Processor.
    row("processor-hang", &[at("node-hang:joint3", FOR_GOOD)], Phase::Flight,
        stop_axis(3, [0.0, 60.0], 51.1, 75.0), &[LatchedBy(3, Fault::UnexpectedReset), SaysReset(3, ResetCause::Watchdog)])
        .noted("the watchdog period is 50 ms (firmware/board/BOARD.md), not the 20 ms of the matrix: a flash save stalls the board for about 20 ms"),
    row("stack-overflow", &[at("processor-fault:joint2", FOR_GOOD)], Phase::Push,
        stop_axis(2, [0.0, 41.0], 1.1, ABSENT_SHUT_MS), &[SaysReset(2, ResetCause::ProcessorFault)])
        .noted("the stack lies below all variables, so an overflow is a processor fault (in emulation the image's own handler runs: tests/system/pil_faults.rs); `cargo xtask sizes` bounds the worst stack of the images"),
    row("panic", &[at("processor-fault:wheel8", FOR_GOOD)], Phase::Push,
        stop_axis(8, [0.0, 41.0], 1.1, ABSENT_SHUT_MS), &[SaysReset(8, ResetCause::ProcessorFault)])
        .noted("the panic handler does the same as the fault handler; the link check proves that no panic is reachable"),
    // Time.
    row("clock-drift/200ppm", &[at("clock-drift:joint6=200", FOR_GOOD)], Phase::Flight, goes_on(10.0), &[]),
    row("clock-drift/beyond", &[at("clock-drift:joint6=-30000", LONGER_S)], Phase::Flight,
        stop([0.0, 500.0], 540.0), &[FoundAt(7, Finding::SlotsOverlap), LatchedBy(6, Fault::SlotOverrun)])
        .silent_about(&[Found(Finding::SlotBabble), Found(Finding::Babbler)]).lasting(3.5)
        .noted("the neighbours' slots overlap at once; the board reports its wrong clock after 1.7 s"),
    row("cycle-jitter/1ms", &[at("cycle-jitter=1", FOR_GOOD)], Phase::Flight, goes_on(10.0), &[]),
    // Master's layers.
    row("fifo-full", &[at("command-flood=100", 0.5)], Phase::Flight, goes_on(0.001), &[FloodRefused(Layer::Zero)]),
    row("layer1-stall/flight", &[at("layer1-stall", 0.3)], Phase::Flight,
        stop([89.0, 111.0], 140.0), &[Hold(HoldReason::LayerOneStalled)]),
    row("layer1-stall/push", &[at("layer1-stall", 0.3)], Phase::Push,
        stop([89.0, 111.0], 140.0), &[Hold(HoldReason::LayerOneStalled)]),
    row("layer1-panic", &[at("master-reset=1000", FOR_GOOD)], Phase::Push,
        stop(LINK_MS, LINK_SHUT_MS), &[Latched(Fault::LinkLost)])
        .noted("both layers are one program: when it ends, the boards see a silent master, and later one that restarts"),
    // User interface.
    row("ui-link-lost", &[], Phase::Flight, stop(OPERATOR_MS, OPERATOR_SHUT_MS), OPERATOR_GONE)
        .of_connection(Connection::Lost),
    row("ui-half-open", &[], Phase::Push, stop(OPERATOR_MS, OPERATOR_SHUT_MS), OPERATOR_GONE)
        .of_connection(Connection::HalfOpen)
        .noted("heartbeats continue, but acknowledge nothing new: they do not extend control"),
    row("ui-slow", &[], Phase::Flight, stop(OPERATOR_MS, OPERATOR_SHUT_MS), OPERATOR_GONE)
        .of_connection(Connection::Slow)
        .noted("heartbeats arrive, each later than an operator may be"),
    row("ui-reconnects", &[], Phase::Push, stop(OPERATOR_MS, OPERATOR_SHUT_MS), OPERATOR_GONE)
        .of_connection(Connection::Reconnects)
        .silent_about(&[Done(CommandCode::JointReference)])
        .noted("none of the 1,000 commands that waited in the client, and of the 100 from the previous session, is executed"),
    row("ui-second-client", &[], Phase::Flight, goes_on(0.001), &[])
        .of_connection(Connection::SecondClient)
        .silent_about(&[Hold(HoldReason::OperatorLost)])
        .noted("it has the control key; that it may stop is tested over sockets"),
    row("ui-bad-mac", &[], Phase::Flight, goes_on(0.001), &[])
        .of_connection(Connection::BadMac)
        .silent_about(&[Hold(HoldReason::OperatorLost)])
        .noted("every frame of the holder, with each of its bits flipped"),
    row("ui-replay", &[], Phase::Push, goes_on(0.001), &[])
        .of_connection(Connection::Replay)
        .silent_about(&[Hold(HoldReason::OperatorLost)]),
    // Parameters.
    row("invalid-parameter/joint", &[at("invalid-parameter:joint3", FOR_GOOD)], Phase::Push, goes_on(0.001),
        &refusals(3)),
    row("invalid-parameter/wheel", &[at("invalid-parameter:wheel7", FOR_GOOD)], Phase::Stand, goes_on(0.001),
        &refusals(7)),
    // Versions.
    row("version-mismatch/joint", &[at("other-interface:joint4", FOR_GOOD)], Phase::PowerUp,
        Expect::NoArming, &[OtherInterface(4)]),
    row("version-mismatch/wheel", &[at("other-interface:wheel7", FOR_GOOD)], Phase::PowerUp,
        Expect::NoArming, &[OtherInterface(7)]),
    // Host.
    row("disk-full", &[at("disk-full", FOR_GOOD)], Phase::Flight, goes_on(0.0), &[MessagesLost]),
    row("log-writer-slow",
        &[later("disk-full", 0.0, 0.1), later("disk-full", 0.3, 0.1), later("disk-full", 0.6, 0.1)],
        Phase::Flight, goes_on(0.0), &[MessagesLost])
        .noted("a slow writer accepts nothing for a third of the time"),
];
