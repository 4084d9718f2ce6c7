//! The topics of a bag and their message types, as ROS 2 defines them.

/// A topic, by its place in [`TOPICS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topic {
    JointStates,
    Tf,
    TfStatic,
    RobotDescription,
    Clock,
}

/// A message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    JointState,
    TfMessage,
    Text,
    Clock,
}

pub(super) struct TopicDef {
    pub(super) name: &'static str,
    pub(super) kind: Kind,
    /// A late subscriber gets the last message: durability "transient local".
    pub(super) latched: bool,
}

const fn topic(name: &'static str, kind: Kind, latched: bool) -> TopicDef {
    TopicDef {
        name,
        kind,
        latched,
    }
}

pub(super) static TOPICS: [TopicDef; 5] = [
    topic("/joint_states", Kind::JointState, false),
    topic("/tf", Kind::TfMessage, false),
    topic("/tf_static", Kind::TfMessage, true),
    topic("/robot_description", Kind::Text, true),
    topic("/clock", Kind::Clock, false),
];

const TIME: &str = "int32 sec\nuint32 nanosec\n";
const HEADER: &str = "builtin_interfaces/Time stamp\nstring frame_id\n";

/// Types within a type, in the order of their first use.
const fn within(kind: Kind) -> &'static [(&'static str, &'static str)] {
    match kind {
        Kind::JointState => &[
            ("std_msgs/Header", HEADER),
            ("builtin_interfaces/Time", TIME),
        ],
        Kind::TfMessage => &[
            (
                "geometry_msgs/TransformStamped",
                "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
            ),
            (
                "geometry_msgs/Transform",
                "Vector3 translation\nQuaternion rotation\n",
            ),
            ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
            (
                "geometry_msgs/Quaternion",
                "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
            ),
            ("std_msgs/Header", HEADER),
            ("builtin_interfaces/Time", TIME),
        ],
        Kind::Text => &[],
        Kind::Clock => &[("builtin_interfaces/Time", TIME)],
    }
}

impl Kind {
    /// Name in ROS 2.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::JointState => "sensor_msgs/msg/JointState",
            Self::TfMessage => "tf2_msgs/msg/TFMessage",
            Self::Text => "std_msgs/msg/String",
            Self::Clock => "rosgraph_msgs/msg/Clock",
        }
    }

    /// Definition with those of all types within, as in the encoding `ros2msg`.
    pub(super) fn definition(self) -> String {
        let own = match self {
            Self::JointState => {
                "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
                 float64[] effort\n"
            }
            Self::TfMessage => "geometry_msgs/TransformStamped[] transforms\n",
            Self::Text => "string data\n",
            Self::Clock => "builtin_interfaces/Time clock\n",
        };
        let line = "=".repeat(80);
        let parts = within(self).iter();
        parts.fold(own.to_owned(), |text, (name, fields)| {
            format!("{text}{line}\nMSG: {name}\n{fields}")
        })
    }
}
