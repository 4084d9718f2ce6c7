//! One mistake in a text, as people make them: a unit, a sign, an order of magnitude, lines that
//! change places, a section of another file.

use rand::{Rng, RngExt as _};

/// A text with its lines changed, and the changes.
pub(super) struct Mutant {
    pub(super) text: String,
    pub(super) what: String,
}

/// Units that people confuse, most of them of the same quantity.
const UNITS: [&[&str]; 11] = [
    &["m", "cm", "mm", "um", "s"],
    &["s", "ms", "us", "ns", "m"],
    &["Pa", "kPa", "MPa", "bar", "N"],
    &["N/m", "N/mm", "kN/m", "N"],
    &["N s/m", "N s/mm", "N/m"],
    &["m3/(s Pa)", "dm3/(s bar)", "dm3"],
    &["m3", "dm3", "cm3", "mm3", "l"],
    &["kg", "g", "N", "kg m2"],
    &["deg", "rad", "1"],
    &["m/s", "mm/s", "cm/s", "rad/s", "m/s2"],
    &["1", "%", "", "furlong"],
];

/// Replacements for a number.
const EDGES: [&str; 12] = [
    "0",
    "0.0",
    "-0.0",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e-300",
    "true",
    "\"\"",
    "[]",
    "18446744073709551615",
];

/// One to three mistakes in `text`; sections come from `other`.
pub(super) fn mutate(rng: &mut impl Rng, text: &str, other: &str) -> Mutant {
    let mut mutant = Mutant {
        text: text.to_owned(),
        what: String::new(),
    };
    let mistakes = 1 + rng.random_range(0..6_u32) / 4 + rng.random_range(0..12_u32) / 11;
    for _ in 0..mistakes {
        let (text, what) = mistake(rng, &mutant.text, other);
        mutant.text = text;
        mutant.what = [mutant.what, what].join("; ");
    }
    mutant
}

fn mistake(rng: &mut impl Rng, text: &str, other: &str) -> (String, String) {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let code: Vec<usize> = (0..lines.len())
        .filter(|i| !lines[*i].trim().is_empty() && !lines[*i].starts_with('#'))
        .collect();
    let Some(&at) = pick(rng, &code) else {
        return (text.to_owned(), "nothing left".to_owned());
    };
    let what = match rng.random_range(0..100_u32) {
        0..22 => changed(rng, &mut lines, &code, "unit", unit),
        22..38 => changed(rng, &mut lines, &code, "sign", |_, line| {
            number(line, |n| match n.strip_prefix('-') {
                Some(positive) => positive.to_owned(),
                None => format!("-{n}"),
            })
        }),
        38..68 => changed(rng, &mut lines, &code, "magnitude", |rng, line| {
            let power = [-6, -3, -2, -1, -1, 1, 1, 2, 3, 6];
            let power = power[rng.random_range(0..power.len())];
            number(line, |n| {
                let value = n.parse::<f64>().unwrap_or_default();
                format!("{:?}", value * 10_f64.powi(power))
            })
        }),
        68..74 => changed(rng, &mut lines, &code, "edge", |rng, line| {
            let edge = EDGES[rng.random_range(0..EDGES.len())];
            number(line, |_| edge.to_owned())
        }),
        74..82 => {
            let &to = pick(rng, &code).unwrap_or(&at);
            lines.swap(at, to);
            format!("lines {} and {} swapped", at + 1, to + 1)
        }
        82..92 => {
            let pasted = section(rng, other);
            let heads = code.iter().filter(|i| lines[**i].starts_with('['));
            let heads: Vec<usize> = heads.copied().collect();
            let place = pick(rng, &heads).copied().unwrap_or(lines.len());
            let what = format!("{} pasted before line {}", pasted[0], place + 1);
            lines.splice(place..place, pasted);
            what
        }
        92..95 => format!("line {} lost: {}", at + 1, lines.remove(at)),
        95..98 => {
            lines.insert(at, lines[at].clone());
            format!("line {} twice", at + 1)
        }
        _ => {
            lines.truncate(at);
            format!("cut off at line {}", at + 1)
        }
    };
    (lines.join("\n") + "\n", what)
}

fn pick<'a, T>(rng: &mut impl Rng, of: &'a [T]) -> Option<&'a T> {
    (!of.is_empty()).then(|| &of[rng.random_range(0..of.len())])
}

/// The first line, from a random one on, in which there is something to change.
fn changed<R: Rng>(
    rng: &mut R,
    lines: &mut [String],
    code: &[usize],
    what: &str,
    change: impl Fn(&mut R, &str) -> Option<String>,
) -> String {
    let begin = rng.random_range(0..code.len());
    for &i in code[begin..].iter().chain(&code[..begin]) {
        if let Some(new) = change(rng, &lines[i]) {
            let old = std::mem::replace(&mut lines[i], new);
            return format!("{what} in line {}: {old} -> {}", i + 1, lines[i]);
        }
    }
    format!("no {what} to change")
}

fn unit<R: Rng>(rng: &mut R, line: &str) -> Option<String> {
    let begin = line.find("unit = \"")? + 8;
    let end = begin + line[begin..].find('"')?;
    let family = UNITS
        .iter()
        .find(|units| units.contains(&&line[begin..end]));
    let family = family.unwrap_or(&UNITS[0]);
    let new = family[rng.random_range(0..family.len())];
    Some([&line[..begin], new, &line[end..]].concat())
}

/// The line with the number of its value changed.
fn number(line: &str, change: impl Fn(&str) -> String) -> Option<String> {
    let after = line.find("value = ").map(|at| at + 8);
    let begin = after.or_else(|| line.find("= ").map(|at| at + 2))?;
    let begin = begin + usize::from(line[begin..].starts_with('['));
    let is_part = |c: char| c.is_ascii_digit() || "+-._e".contains(c);
    let rest = &line[begin..];
    let length = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
    let number = &rest[..length];
    number.parse::<f64>().ok()?;
    Some([&line[..begin], &change(number), &rest[length..]].concat())
}

/// A section of a text, its head first.
fn section(rng: &mut impl Rng, text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().collect();
    let heads: Vec<usize> = (0..lines.len())
        .filter(|i| lines[*i].starts_with('['))
        .collect();
    let begin = pick(rng, &heads).copied().unwrap_or(0);
    let length = 1 + lines[begin + 1..]
        .iter()
        .take_while(|line| !line.starts_with('['))
        .count();
    let part = lines[begin..begin + length].iter();
    part.map(|line| (*line).to_owned()).collect()
}
