//! Commands of the host: they act on the simulation or on who is in control, and do not move the robot.

/// An argument of a command of the host.
#[derive(Debug, Clone, Copy)]
pub struct HostArgument {
    /// Name.
    pub name: &'static str,
    /// Kind: `number`, `whole number` or `text`.
    pub kind: &'static str,
    /// Unit; `1` if it has none.
    pub unit: &'static str,
    /// Smallest and largest value of a number.
    pub limits: Option<(f64, f64)>,
    /// Meaning.
    pub doc: &'static str,
}

/// Which command of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostCode {
    /// Stops the clock.
    Pause = 0x0301,
    /// Resumes it.
    Resume = 0x0302,
    /// Some bus cycles of a paused robot.
    Step = 0x0303,
    /// How fast the clock goes.
    Speed = 0x0304,
    /// A fault begins.
    Inject = 0x0305,
    /// A fault ends.
    EndFault = 0x0306,
    /// A recording begins.
    RecordStart = 0x0307,
    /// The recording ends.
    RecordStop = 0x0308,
    /// The control goes to another client.
    HandOver = 0x0309,
    /// The control is revoked.
    Revoke = 0x030A,
}

/// A command that acts on the simulation or on who is in control, and does not move the robot.
#[derive(Debug, Clone, Copy)]
pub struct HostInfo {
    /// Number.
    pub code: HostCode,
    /// Name.
    pub name: &'static str,
    /// Arguments.
    pub arguments: &'static [HostArgument],
    /// Its effect.
    pub effect: &'static str,
}

/// Most bus cycles of one `Step`.
pub const STEP_MAX: u32 = 1_000;
/// Shortest and longest time for which revoked control is reserved for the robot's own computer, s.
pub const HOLD_S: (u32, u32) = (2, 600);
/// Slowest and fastest pace.
pub const SPEED: (f64, f64) = (0.1, 10.0);
/// Fastest pace at which a client may be in control.
pub const SPEED_OF_CONTROL: f64 = 2.0;

const FAULT: HostArgument = HostArgument {
    name: "fault",
    kind: "text",
    unit: "1",
    limits: None,
    doc: "Fault and target, such as `pot-open:joint3`, as `wheeleg faults list` has them.",
};

/// Commands of the host.
pub const HOST_TABLE: &[HostInfo] = &[
    HostInfo {
        code: HostCode::Pause,
        name: "Pause",
        arguments: &[],
        effect: "Stops the clock of the simulation.",
    },
    HostInfo {
        code: HostCode::Resume,
        name: "Resume",
        arguments: &[],
        effect: "Resumes the clock of the simulation.",
    },
    HostInfo {
        code: HostCode::Step,
        name: "Step",
        arguments: &[HostArgument {
            name: "cycles",
            kind: "whole number",
            unit: "1",
            limits: Some((1.0, STEP_MAX as f64)),
            doc: "Bus cycles of 10 ms.",
        }],
        effect: "Simulates some bus cycles of a paused robot.",
    },
    HostInfo {
        code: HostCode::Speed,
        name: "Speed",
        arguments: &[HostArgument {
            name: "speed",
            kind: "number",
            unit: "1",
            limits: Some(SPEED),
            doc: "Ratio of simulated to wall time; above 2 only while nobody is in control.",
        }],
        effect: "Sets the pace of the simulation.",
    },
    HostInfo {
        code: HostCode::Inject,
        name: "Inject",
        arguments: &[FAULT],
        effect: "Injects a fault, which lasts until it is ended or ends by itself.",
    },
    HostInfo {
        code: HostCode::EndFault,
        name: "EndFault",
        arguments: &[FAULT],
        effect: "Ends a fault.",
    },
    HostInfo {
        code: HostCode::RecordStart,
        name: "RecordStart",
        arguments: &[],
        effect: "Starts a recording: the log, and every command with its time, so that the run can be replayed.",
    },
    HostInfo {
        code: HostCode::RecordStop,
        name: "RecordStop",
        arguments: &[],
        effect: "Ends the recording.",
    },
    HostInfo {
        code: HostCode::HandOver,
        name: "HandOver",
        arguments: &[HostArgument {
            name: "to",
            kind: "text",
            unit: "1",
            limits: None,
            doc: "Session of the client, as reported when that client asked for control.",
        }],
        effect: "Releases control, and reserves it for another client for 2 s. Refused in the same cases as ReleaseControl.",
    },
    HostInfo {
        code: HostCode::Revoke,
        name: "Revoke",
        arguments: &[HostArgument {
            name: "hold",
            kind: "whole number",
            unit: "s",
            limits: Some((HOLD_S.0 as f64, HOLD_S.1 as f64)),
            doc: "Time for which only clients on the robot's own computer may then take control.",
        }],
        effect: "Revokes control from its holder, or from who has asked for it, as if the operator were lost: an armed robot holds. For a while after that, only clients on the robot's own computer may take control. Only on that computer.",
    },
];
