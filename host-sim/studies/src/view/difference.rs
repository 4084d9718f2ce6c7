//! Differences between the strokes of two logs, at the times that both have.

use super::content::Content;
use super::signals::JOINTS;

/// Difference from which two strokes count as apart, mm: more than the noise of a potentiometer.
const APART_MM: f32 = 1.0;

/// One joint of two logs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Difference {
    pub(super) joint: &'static str,
    /// Largest difference, mm, and when, s.
    pub(super) largest_mm: f64,
    pub(super) largest_s: f64,
    /// When they are first [`APART_MM`] apart, s.
    pub(super) apart_s: Option<f64>,
    /// Times that both logs have, and the last of them, s.
    pub(super) times: u64,
    pub(super) until_s: f64,
}

/// The six joints.
pub(super) fn differences(one: &Content, other: &Content) -> Vec<Difference> {
    let pairs = one.strokes.iter().zip(&other.strokes);
    let pairs = JOINTS.into_iter().zip(pairs);
    pairs.map(|(joint, (a, b))| of(joint, a, b)).collect()
}

fn of(joint: &'static str, a: &[(u64, f32)], b: &[(u64, f32)]) -> Difference {
    let mut difference = Difference {
        joint,
        largest_mm: 0.0,
        largest_s: 0.0,
        apart_s: None,
        times: 0,
        until_s: 0.0,
    };
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    while let (Some((a_ns, here)), Some((b_ns, there))) = (a.peek(), b.peek()) {
        if a_ns < b_ns {
            a.next();
            continue;
        }
        if b_ns < a_ns {
            b.next();
            continue;
        }
        let (t_s, apart_mm) = (*a_ns as f64 * 1e-9, (here - there).abs());
        difference.times += 1;
        difference.until_s = t_s;
        if f64::from(apart_mm) > difference.largest_mm {
            difference.largest_mm = f64::from(apart_mm);
            difference.largest_s = t_s;
        }
        if apart_mm >= APART_MM {
            difference.apart_s.get_or_insert(t_s);
        }
        a.next();
        b.next();
    }
    difference
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_equal_times_are_compared() {
        let a = [(0, 10.0), (2_000_000_000, 20.0), (4_000_000_000, 30.0)];
        let b = [
            (1_000_000_000, 99.0),
            (2_000_000_000, 20.5),
            (4_000_000_000, 33.0),
        ];
        let found = of("joint", &a, &b);
        assert_eq!(
            (found.times, found.largest_mm, found.largest_s),
            (2, 3.0, 4.0)
        );
        assert_eq!((found.apart_s, found.until_s), (Some(4.0), 4.0));
        assert_eq!(of("joint", &a, &[]).times, 0);
    }
}
