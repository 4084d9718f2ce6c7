//! Robot and axis files with other values.

/// The robot of the paper with cylinders of 90 mm, standing: paths, values as written, and units.
pub(crate) const SHORT: &[(&str, &str, &str)] = &[
    ("cylinder.stroke", "90.0", "mm"),
    ("gait.stroke", "90.0", "mm"),
    ("gait.held_leg_s6", "90.0", "mm"),
    ("start.vertical.stroke", "90.0", "mm"),
    ("body.foot_pad", "0.20", "m"),
    ("node.joint.sensor_max", "95.0", "mm"),
];

/// A file with other values; a key missing in its section is put below the heading, a missing section at the
/// end.
pub(crate) fn with(text: &str, path: &str, value: &str, unit: &str) -> String {
    let (section, key) = path.rsplit_once('.').expect("a section and a key");
    let heading = format!("[{section}]\n");
    let text = match text.contains(&heading) {
        true => text.to_owned(),
        false => format!("{text}\n{heading}"),
    };
    let begin = text.find(&heading).expect("the section") + heading.len();
    let field = format!("{key} = {{ value = {value}, unit = \"{unit}\", source = \"ASSUMED\" }}");
    let end = text[begin..]
        .find("\n[")
        .map_or(text.len(), |at| begin + at);
    let line = text[begin..end].lines().find(|line| {
        let (name, _) = line.split_once('=').unwrap_or_default();
        name.trim() == key
    });
    let mut changed = text.clone();
    match line {
        Some(line) => {
            let at = begin + text[begin..].find(line).expect("it stands there");
            changed.replace_range(at..at + line.len(), &field);
        }
        None => changed.insert_str(begin, &(field + "\n")),
    }
    changed
}
