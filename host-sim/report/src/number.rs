//! Numbers as people read them: a true minus sign, none on zero, thin spaces between
//! thousands. Templates have the same as filters: `{{ delay_s | fixed(3, "never") }}`.

use minijinja::{Environment, Error, ErrorKind, Value};

/// Printed if there is no number.
pub const DASH: &str = "–";

/// `value` with `digits` decimals.
#[must_use]
pub fn fixed(value: f64, digits: usize) -> String {
    minus(&rounded(value, digits))
}

/// The same with the minus of a keyboard, for terminals.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.bytes().all(|b| matches!(b, b'0' | b'.')) => zero.to_owned(),
        _ => text,
    }
}

/// The same, or a dash.
#[must_use]
pub fn or_dash(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| DASH.to_owned(), |value| fixed(value, digits))
}

/// A difference: always with its sign, except for zero.
#[must_use]
pub fn signed(value: f64, digits: usize) -> String {
    let text = fixed(value, digits);
    let zero = text.bytes().all(|b| matches!(b, b'0' | b'.'));
    if zero || value < 0.0 {
        text
    } else {
        format!("+{text}")
    }
}

/// At most `digits` decimals, without trailing zeros.
#[must_use]
pub fn trimmed(value: f64, digits: usize) -> String {
    let text = fixed(value, digits);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// At most four significant digits.
#[must_use]
pub fn short(value: f64) -> String {
    if value.abs() < 1e-12 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&value.abs()) {
        trimmed(
            value,
            (3 - value.abs().log10().floor() as i32).clamp(0, 6) as usize,
        )
    } else {
        minus(&format!("{value:.2e}"))
    }
}

/// A probability of a test, which is never 0: with three decimals, below 0.001 as a power of ten that it lies below.
#[must_use]
pub fn p_value(p: f64) -> String {
    minus(&p_text(p))
}

/// The same with the minus of a keyboard and an equals sign, for sentences on terminals: `p = 0.012`, `p < 1e-6`.
#[must_use]
pub fn p_equals(p: f64) -> String {
    let text = p_text(p);
    match text.starts_with('<') {
        true => format!("p {text}"),
        false => format!("p = {text}"),
    }
}

fn p_text(p: f64) -> String {
    if p >= 1e-3 {
        return format!("{p:.3}");
    }
    // Of more than a thousand pairs on one side alone it is below the smallest number.
    let power = p.max(f64::MIN_POSITIVE).log10().floor() + 1.0;
    format!("< 1e{power:.0}")
}

/// A count with a thin space between groups of three digits.
#[must_use]
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(digit);
    }
    out
}

/// A count with its word: one axis, two axes.
#[must_use]
pub fn counted(count: usize, one: &str, more: &str) -> String {
    let word = if count == 1 { one } else { more };
    format!("{} {word}", grouped(count as u64))
}

/// Names in a sentence: a, b and c.
#[must_use]
pub fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// A text of numbers with true minus signs.
#[must_use]
pub fn minus(text: &str) -> String {
    text.replace('-', "−")
}

/// Makes a filter of a formatter: a value is formatted; without one the filter gives its word, or else a
/// dash. An unknown name is an error.
fn filter(
    value: &Value,
    none: Option<String>,
    format: impl Fn(f64) -> String,
) -> Result<String, Error> {
    if value.is_undefined() {
        Err(ErrorKind::UndefinedError.into())
    } else if value.is_none() {
        Ok(none.unwrap_or_else(|| DASH.to_owned()))
    } else {
        f64::try_from(value.clone()).map(format)
    }
}

/// Filters `fixed`, `ms` (of seconds), `percent` (of a share), `signed`, each with the
/// number of decimals; `trimmed`, `p_value`, `short`, `grouped`, `minus`.
pub(crate) fn add_filters(env: &mut Environment<'_>) {
    type None = Option<String>;
    env.add_filter("fixed", |v: Value, digits: usize, none: None| {
        filter(&v, none, |v| fixed(v, digits))
    });
    env.add_filter("ms", |v: Value, digits: usize, none: None| {
        filter(&v, none, |v| fixed(1e3 * v, digits))
    });
    env.add_filter("percent", |v: Value, digits: usize, none: None| {
        filter(&v, none, |v| fixed(1e2 * v, digits))
    });
    env.add_filter("signed", |v: Value, digits: usize, none: None| {
        filter(&v, none, |v| signed(v, digits))
    });
    env.add_filter("trimmed", |v: Value, digits: usize| {
        filter(&v, None, |v| trimmed(v, digits))
    });
    env.add_filter("p_value", |v: Value| filter(&v, None, p_value));
    env.add_filter("short", |v: Value, none: None| filter(&v, none, short));
    env.add_filter("grouped", |v: Value| {
        if v.is_none() {
            Ok(DASH.to_owned())
        } else {
            u64::try_from(v).map(grouped)
        }
    });
    env.add_filter("minus", |text: String| minus(&text));
}

#[cfg(test)]
mod tests {
    #[test]
    fn counts_and_lists_read_as_a_sentence() {
        let told = [0, 1, 2000].map(|n| super::counted(n, "axis", "axes"));
        assert_eq!(told, ["0 axes", "1 axis", "2\u{2009}000 axes"]);
        let names = ["a", "b", "c"].map(str::to_owned);
        let told = [0, 1, 2, 3].map(|n| super::listed(&names[..n]));
        assert_eq!(told, ["", "a", "a and b", "a, b and c"]);
    }

    use super::*;

    #[test]
    fn zero_has_no_sign_and_less_than_zero_has_the_right_one() {
        assert_eq!(fixed(-0.0001, 3), "0.000");
        assert_eq!(fixed(-0.0123, 3), "−0.012");
        assert_eq!(fixed(0.2018, 3), "0.202");
        assert_eq!(
            [signed(3.2, 0), signed(-3.2, 0), signed(-0.2, 0)],
            ["+3", "−3", "0"]
        );
        assert_eq!([or_dash(None, 1), or_dash(Some(-1.0), 1)], ["–", "−1.0"]);
    }

    #[test]
    fn a_terminal_has_the_minus_of_a_keyboard() {
        for (value, decimals, text) in [
            (-0.4, 0, "0"),
            (-0.04, 1, "0.0"),
            (-0.06, 1, "-0.1"),
            (-3.0, 0, "-3"),
        ] {
            assert_eq!(rounded(value, decimals), text);
        }
    }

    #[test]
    fn numbers_are_short_and_right() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (22.5, "22.5"),
            (-5.625, "−5.625"),
            (240.0, "240"),
            (9.549_296_6, "9.549"),
            (2.0e-7, "2.00e−7"),
            (12345.6, "12346"),
        ] {
            assert_eq!(short(value), text);
        }
        assert_eq!(
            [trimmed(100.0, 0), trimmed(0.25, 6), trimmed(-0.0, 6)],
            ["100", "0.25", "0"]
        );
    }

    #[test]
    fn a_probability_is_never_nothing() {
        for (p, told) in [
            (1.0, "p = 1.000"),
            (0.0123, "p = 0.012"),
            (1e-3, "p = 0.001"),
            (9.99e-4, "p < 1e-3"),
            (3.2e-7, "p < 1e-6"),
            (4e-247, "p < 1e-246"),
            (0.0, "p < 1e-307"),
        ] {
            assert_eq!(p_equals(p), told);
        }
        assert_eq!([p_value(0.5), p_value(2e-9)], ["0.500", "< 1e−8"]);
    }

    #[test]
    fn counts_are_grouped() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(8_123_456), "8\u{2009}123\u{2009}456");
    }

    #[test]
    fn templates_have_the_same() {
        let mut env = Environment::new();
        add_filters(&mut env);
        let shown = |template: &str| {
            let values =
                minijinja::context! { a => -0.25, n => 1500_u32, no => None::<f64>, t => "-1" };
            env.render_str(template, values).map_err(|e| e.kind())
        };
        for (template, text) in [
            (
                "{{ a | fixed(1) }} {{ no | fixed(1) }} {{ no | fixed(1, 'never') }}",
                "−0.2 – never",
            ),
            (
                "{{ a | ms(0) }} {{ a | percent(0) }} {{ a | signed(2) }}",
                "−250 −25 −0.25",
            ),
            (
                "{{ n | grouped }} {{ no | grouped }} {{ a | short }} {{ t | minus }}",
                "1\u{2009}500 – −0.25 −1",
            ),
        ] {
            assert_eq!(shown(template).as_deref(), Ok(text));
        }
        assert_eq!(
            shown("{{ nobody | fixed(1) }}"),
            Err(ErrorKind::UndefinedError)
        );
        assert!(shown("{{ nobody | grouped }}").is_err());
    }
}
