//! Fewer points for the same line: points that a straight line replaces are dropped.

/// The points of a line that keep it within `tolerance` of all of them, by Ramer, Douglas and Peucker;
/// distances are along y, which keeps the height of peaks.
pub(super) fn simplified(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let Some(last) = points.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut needed = vec![false; points.len()];
    needed[0] = true;
    needed[last] = true;
    let mut stretches = vec![(0, last)];
    while let Some((from, to)) = stretches.pop() {
        let (a, b) = (points[from], points[to]);
        let width = b.0 - a.0;
        let away = |i: &usize| {
            let (x, y) = points[*i];
            let part = if width > 0.0 { (x - a.0) / width } else { 0.0 };
            (y - (a.1 + part * (b.1 - a.1))).abs()
        };
        let farthest = (from + 1..to).max_by(|i, j| away(i).total_cmp(&away(j)));
        if let Some(farthest) = farthest.filter(|i| away(i) > tolerance) {
            needed[farthest] = true;
            stretches.push((from, farthest));
            stretches.push((farthest, to));
        }
    }
    let kept = points.iter().zip(needed).filter(|(_, needed)| *needed);
    kept.map(|(point, _)| *point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_parts_have_two_points_and_peaks_stay() {
        let mut points: Vec<(f64, f64)> = (0..1000).map(|i| (f64::from(i), 0.0)).collect();
        points[500].1 = 7.0;
        let kept = simplified(&points, 0.1);
        assert_eq!(
            kept,
            [
                (0.0, 0.0),
                (499.0, 0.0),
                (500.0, 7.0),
                (501.0, 0.0),
                (999.0, 0.0)
            ]
        );
        assert!(simplified(&[], 0.1).is_empty());
        assert_eq!(simplified(&[(1.0, 2.0)], 0.1), [(1.0, 2.0)]);
    }

    #[test]
    fn no_point_is_farther_from_the_line_than_allowed() {
        let wave = (0..2000).map(|i| (f64::from(i) * 0.01, (f64::from(i) * 0.01).sin()));
        let wave: Vec<(f64, f64)> = wave.collect();
        let kept = simplified(&wave, 1e-3);
        assert!(kept.len() < 400, "{}", kept.len());
        for (x, y) in wave {
            let after = kept.partition_point(|p| p.0 < x).max(1);
            let (a, b) = (kept[after - 1], kept[after]);
            let line = a.1 + (x - a.0) / (b.0 - a.0) * (b.1 - a.1);
            assert!((line - y).abs() <= 1e-3 + 1e-12, "at {x}");
        }
    }
}
