//! Axis files made of others.

/// A text with other values: path of the field, value, unit.
pub(crate) fn changed(text: &str, changes: &[(&str, f64, &str)]) -> String {
    let mut text = text.to_owned();
    for (path, value, unit) in changes {
        let (section, key) = path.rsplit_once('.').expect("a section and a key");
        let begin = text.find(&format!("[{section}]\n")).expect("the section");
        let is_key = |line: &&str| line.split('=').next().is_some_and(|k| k.trim() == key);
        let line = text[begin..]
            .lines()
            .find(is_key)
            .expect("the key")
            .to_owned();
        let at = begin + text[begin..].find(&line).expect("it stands there");
        let new =
            format!("{key} = {{ value = {value:.6}, unit = \"{unit}\", source = \"ASSUMED\" }}");
        text.replace_range(at..at + line.len(), &new);
    }
    text
}
