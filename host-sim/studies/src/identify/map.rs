//! Maps the columns of a user's own table to those of a measurement.

use std::str::FromStr;

/// Names of all columns.
const NAMES: [&str; 13] = [
    "time_s",
    "position_mm",
    "fill_a",
    "vent_a",
    "fill_b",
    "vent_b",
    "fill_a_us",
    "vent_a_us",
    "fill_b_us",
    "vent_b_us",
    "pressure_a_bar",
    "pressure_b_bar",
    "load_n",
];

/// One column: `NAME=COLUMN`, or for another unit `NAME=COLUMN*FACTOR+OFFSET`.
///
/// `position_mm=x (m)*1000`, `pressure_a_bar=P1*0.01+1.013`; a column may hold two valves: `fill_a=V1` and
/// `vent_a=V1*-1+1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// Its name here.
    pub name: &'static str,
    /// Its name in the table.
    pub column: String,
    /// Factor on its values.
    pub factor: f64,
    /// Offset added to them then.
    pub offset: f64,
}

impl FromStr for Mapped {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const FORM: &str = "write NAME=COLUMN, or NAME=COLUMN*FACTOR+OFFSET";
        let (name, rest) = text.split_once('=').ok_or(FORM)?;
        let known = NAMES.into_iter().find(|known| *known == name.trim());
        let name = known.ok_or_else(|| {
            format!(
                "`{}` is not known; accepted: {}",
                name.trim(),
                NAMES.join(", ")
            )
        })?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        // From the end: the name of a column may hold any of these characters.
        let tail = |text: &str, sign: char| -> Option<(String, f64)> {
            let (before, after) = text.rsplit_once(sign)?;
            Some((before.to_owned(), number(after)?))
        };
        // The exponent of a factor has a sign, too: a text that is a number as a whole has no offset.
        let (column, factor, offset) = if let Some((column, factor)) = tail(rest, '*') {
            (column, factor, 0.0)
        } else if let Some((before, offset)) = tail(rest, '+') {
            let scaled = tail(&before, '*');
            let (column, factor) = scaled.unwrap_or((before, 1.0));
            (column, factor, offset)
        } else {
            (rest.to_owned(), 1.0, 0.0)
        };
        let column = column.trim().to_owned();
        if column.is_empty() {
            return Err(FORM.to_owned());
        }
        if factor == 0.0 {
            return Err(format!(
                "the factor of `{name}` is 0: allowed is any other number"
            ));
        }
        Ok(Self {
            name,
            column,
            factor,
            offset,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_factors_and_offsets_are_read_from_the_end() {
        for (text, column, factor, offset) in [
            ("time_s=Time", "Time", 1.0, 0.0),
            ("time_s= t [ms] * 1e-3", "t [ms]", 1e-3, 0.0),
            ("position_mm=a*b+c", "a*b+c", 1.0, 0.0),
            ("position_mm=x*1e+3", "x", 1e3, 0.0),
            ("position_mm=x=y*1000+-12.5", "x=y", 1e3, -12.5),
            ("vent_a=V1*-1+1", "V1", -1.0, 1.0),
            ("pressure_a_bar=P1+1.013", "P1", 1.0, 1.013),
        ] {
            let read: Mapped = text.parse().expect(text);
            assert_eq!(
                (read.column.as_str(), read.factor, read.offset),
                (column, factor, offset),
                "{text}"
            );
        }
        for (text, word) in [
            ("Time", "NAME=COLUMN"),
            ("time_s=", "NAME=COLUMN"),
            ("time=Time", "accepted: time_s"),
            ("load_n=F*0", "the factor of `load_n` is 0"),
        ] {
            let refused = text.parse::<Mapped>().expect_err(text);
            assert!(refused.contains(word), "{text}: {refused}");
        }
    }
}
