//! Fast, exact number formatting for log payloads.
//!
//! Every physical signal has a stated resolution in the registry, so a payload
//! number is a decimal with a fixed number of digits after the point: shorter
//! and several times faster than shortest-round-trip float formatting, and
//! independent of any library version.

const POW10: [f64; 10] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// Largest scaled magnitude written in fixed-point form; beyond it `f64` has
/// no fractional digits left anyway.
const MAX_SCALED: f64 = 9.0e15;

/// Appends `value` rounded half away from zero to `decimals` (0 to 9) digits
/// after the point, without trailing zeros. Non-finite values become `null`,
/// as JSON has no other way to say it.
pub fn push_fixed(out: &mut Vec<u8>, value: f64, decimals: u8) {
    if !value.is_finite() {
        out.extend_from_slice(b"null");
        return;
    }
    let decimals = decimals.min(9);
    let scaled = value * POW10[usize::from(decimals)];
    if scaled.abs() >= MAX_SCALED {
        out.extend_from_slice(format!("{value:e}").as_bytes());
        return;
    }
    let magnitude = (scaled.abs() + 0.5) as u64;
    if magnitude == 0 {
        out.push(b'0');
        return;
    }
    if scaled < 0.0 {
        out.push(b'-');
    }
    push_scaled(out, magnitude, decimals);
}

/// Appends an unsigned integer.
pub(crate) fn push_u64(out: &mut Vec<u8>, value: u64) {
    push_scaled(out, value, 0);
}

/// Appends a signed integer.
pub(crate) fn push_i64(out: &mut Vec<u8>, value: i64) {
    if value < 0 {
        out.push(b'-');
    }
    push_scaled(out, value.unsigned_abs(), 0);
}

/// Appends `magnitude / 10^decimals`, without trailing zeros after the point.
fn push_scaled(out: &mut Vec<u8>, mut magnitude: u64, decimals: u8) {
    let mut decimals = usize::from(decimals);
    while decimals > 0 && magnitude.is_multiple_of(10) {
        magnitude /= 10;
        decimals -= 1;
    }
    let mut digits = [b'0'; 24];
    let mut at = digits.len();
    let mut written = 0;
    while magnitude > 0 || written <= decimals {
        if written == decimals && decimals > 0 {
            at -= 1;
            digits[at] = b'.';
        }
        at -= 1;
        digits[at] = b'0' + (magnitude % 10) as u8;
        magnitude /= 10;
        written += 1;
    }
    out.extend_from_slice(&digits[at..]);
}

/// Appends a JSON string with the escapes the format demands.
pub(crate) fn push_json_string(out: &mut Vec<u8>, text: &str) {
    out.push(b'"');
    for c in text.chars() {
        match c {
            '"' => out.extend_from_slice(b"\\\""),
            '\\' => out.extend_from_slice(b"\\\\"),
            '\n' => out.extend_from_slice(b"\\n"),
            c if u32::from(c) < 0x20 => {
                out.extend_from_slice(format!("\\u{:04x}", u32::from(c)).as_bytes());
            }
            c => {
                let mut utf8 = [0; 4];
                out.extend_from_slice(c.encode_utf8(&mut utf8).as_bytes());
            }
        }
    }
    out.push(b'"');
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixed(value: f64, decimals: u8) -> String {
        let mut out = Vec::new();
        push_fixed(&mut out, value, decimals);
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn writes_what_a_person_would() {
        assert_eq!(fixed(0.0, 5), "0");
        assert_eq!(fixed(-0.0, 5), "0");
        assert_eq!(fixed(12.5, 3), "12.5");
        assert_eq!(fixed(-0.001, 3), "-0.001");
        assert_eq!(fixed(-0.0004, 3), "0");
        assert_eq!(fixed(0.0005, 3), "0.001");
        assert_eq!(fixed(100.0, 0), "100");
        assert_eq!(fixed(1000.0, 2), "1000");
        assert_eq!(fixed(179.99999, 4), "180");
        assert_eq!(fixed(f64::NAN, 4), "null");
        assert_eq!(fixed(f64::INFINITY, 4), "null");
        assert_eq!(fixed(1e18, 4), "1e18");
    }

    #[test]
    fn agrees_with_the_standard_library_within_the_stated_resolution() {
        for i in -4000..4000 {
            let value = f64::from(i) * 0.037_213_7;
            for decimals in 0..=9 {
                let read: f64 = fixed(value, decimals).parse().expect("a number");
                let half_digit = 0.5 / POW10[usize::from(decimals)];
                assert!(
                    (read - value).abs() <= half_digit * (1.0 + 1e-6),
                    "{value} {decimals}"
                );
            }
        }
    }

    #[test]
    fn strings_survive_a_json_parser() {
        let text = "a \"b\" \\ \n\t\u{1} é";
        let mut out = Vec::new();
        push_json_string(&mut out, text);
        let back: String = serde_json::from_slice(&out).expect("valid JSON");
        assert_eq!(back, text);
    }
}
