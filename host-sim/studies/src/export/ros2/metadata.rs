//! `metadata.yaml` of a bag, in version 5, which Humble and all later versions read.

use super::types::TOPICS;

const FOREVER: &str = "sec: 9223372036\n    nsec: 854775807";

/// Quality of service of a topic, as YAML in a text, like in rosbag2.
pub(super) fn profiles(latched: bool) -> String {
    // Reliable; transient local or volatile.
    let durability = if latched { 1 } else { 2 };
    format!(
        "- history: 1\n  depth: 10\n  reliability: 1\n  durability: {durability}\n  \
         deadline:\n    {FOREVER}\n  lifespan:\n    {FOREVER}\n  liveliness: 1\n  \
         liveliness_lease_duration:\n    {FOREVER}\n  avoid_ros_namespace_conventions: false"
    )
}

/// The file: the bag has one file, and these numbers of messages.
pub(super) fn write(file: &str, counts: &[u64], first_ns: u64, last_ns: u64) -> String {
    let total: u64 = counts.iter().sum();
    let span = last_ns - first_ns;
    let topics: String = TOPICS
        .iter()
        .zip(counts)
        .map(|(topic, count)| {
            let profiles = profiles(topic.latched).replace('\n', "\\n");
            format!(
                "    - topic_metadata:\n        name: {}\n        type: {}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"{profiles}\"\n      \
                 message_count: {count}\n",
                topic.name,
                topic.kind.name()
            )
        })
        .collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
         duration:\n    nanoseconds: {span}\n  starting_time:\n    \
         nanoseconds_since_epoch: {first_ns}\n  message_count: {total}\n  \
         topics_with_message_count:\n{topics}  compression_format: \"\"\n  \
         compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    \
         - path: {file}\n      starting_time:\n        nanoseconds_since_epoch: {first_ns}\n      \
         duration:\n        nanoseconds: {span}\n      message_count: {total}\n"
    )
}
