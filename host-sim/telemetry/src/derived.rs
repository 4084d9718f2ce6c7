//! Channels of a log that are computed from the recorded ones: the same robot in the formats of other
//! programs. They are no part of the hash, of the tables or of the console.

use super::contact::Contact;
use super::registry::{Written, rate};
use super::sink::Taken;

/// A channel that is computed from others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Derived {
    /// Every link of the robot against its parent.
    Tf,
    /// Every joint of the robot.
    JointStates,
    /// Ground and shapes of the robot: once.
    Scene,
    /// Forces of the ground on the robot.
    Contacts,
    /// Events.
    Log,
}

/// Description of a derived channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DerivedDef {
    /// Topic name in the log.
    pub topic: &'static str,
    /// Schema name in the log: one of those that Foxglove publishes.
    pub schema: &'static str,
    /// JSON schema, as published.
    pub json_schema: &'static str,
    /// Messages per second; 0 for a channel written on change.
    pub rate_hz: u32,
    /// Meaning.
    pub doc: &'static str,
}

impl DerivedDef {
    /// In which runs it has messages.
    #[must_use]
    pub const fn written(&self) -> Written {
        match self.rate_hz {
            0 => Written::OnChange,
            _ => Written::Always,
        }
    }

    /// How often it has messages, for people.
    #[must_use]
    pub fn rate(&self) -> String {
        rate(self.rate_hz, self.written())
    }
}

/// Messages per second for moving things. A drawing between two messages errs by less than its line.
pub const DERIVED_HZ: u32 = 50;
/// The same for forces: they take most room, and are only looked at.
pub const CONTACTS_HZ: u32 = 25;
/// Its period, ns.
pub(crate) const CONTACTS_PERIOD_NS: u64 = 1_000_000_000 / CONTACTS_HZ as u64;

const SCENE_UPDATE: (&str, &str) = (
    "foxglove.SceneUpdate",
    include_str!("../foxglove/SceneUpdate.json"),
);

const fn def(
    topic: &'static str,
    (schema, json_schema): (&'static str, &'static str),
    rate_hz: u32,
    doc: &'static str,
) -> DerivedDef {
    DerivedDef {
        topic,
        schema,
        json_schema,
        rate_hz,
        doc,
    }
}

/// In the order of [`Derived`].
static DERIVED: [DerivedDef; 5] = [
    def(
        "/tf",
        (
            "foxglove.FrameTransforms",
            include_str!("../foxglove/FrameTransforms.json"),
        ),
        DERIVED_HZ,
        "Every link of the robot's URDF against its parent, and base_link against world",
    ),
    def(
        "/joint_states",
        (
            "foxglove.JointStates",
            include_str!("../foxglove/JointStates.json"),
        ),
        DERIVED_HZ,
        "Every moving joint of the robot's URDF in SI units, passive ones too",
    ),
    def(
        "/scene",
        SCENE_UPDATE,
        0,
        "Ground, and the robot's shapes on its frames: once, at the first sample",
    ),
    def(
        "/scene/contacts",
        SCENE_UPDATE,
        CONTACTS_HZ,
        "Force of the ground at each contact, 2 mm per newton, with depth, slip and material",
    ),
    def(
        "/log",
        ("foxglove.Log", include_str!("../foxglove/Log.json")),
        0,
        "Events, as messages with a level",
    ),
];

impl Derived {
    /// Its description.
    #[must_use]
    pub fn def(self) -> &'static DerivedDef {
        &DERIVED[self as usize]
    }

    /// The channel of a topic.
    #[must_use]
    pub fn of_topic(topic: &str) -> Option<Self> {
        [
            Self::Tf,
            Self::JointStates,
            Self::Scene,
            Self::Contacts,
            Self::Log,
        ]
        .into_iter()
        .find(|channel| channel.def().topic == topic)
    }
}

/// All derived channels, in log order: behind those of [`channels`](crate::channels).
#[must_use]
pub fn derived() -> &'static [DerivedDef] {
    &DERIVED
}

/// A file that a log carries.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attached {
    /// Name of the file.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// Contents.
    pub data: Vec<u8>,
}

/// Takes a message of a derived channel: time in ns and JSON.
pub type Put<'a> = &'a mut dyn FnMut(Derived, u64, &[u8]);

/// Makes derived channels from the samples of a log.
pub trait Derive {
    /// Files for the log.
    fn attached(&self) -> Vec<Attached>;

    /// A sample that is due in the log.
    fn sample(&mut self, taken: &Taken<'_>, put: Put<'_>);

    /// The contacts with the ground.
    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], put: Put<'_>);
}
