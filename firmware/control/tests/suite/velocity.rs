//! Velocity estimate: exactness, delay, noise, range.

use proptest::prelude::*;
use wheeleg_control::paper::velocity::{MAX_WINDOW, VelocityEstimator, VelocityWindow};
use wheeleg_units::{PositionMm, VelocityMmS};

fn window(length: u8) -> VelocityWindow {
    VelocityWindow::new(length, 1000).expect("valid")
}

/// The definition, in floats, over the last `length` samples.
fn slope(samples: &[i32], length: usize) -> f64 {
    let last: Vec<f64> = samples[samples.len() - length..]
        .iter()
        .map(|&y| f64::from(y))
        .collect();
    let middle = (length - 1) as f64 / 2.0;
    let mean = last.iter().sum::<f64>() / length as f64;
    let pairs = last
        .iter()
        .enumerate()
        .map(|(k, y)| (k as f64 - middle, y - mean));
    let (top, bottom) = pairs.fold((0.0, 0.0), |(t, b), (k, y)| (t + k * y, b + k * k));
    top / bottom * 1000.0
}

#[test]
fn only_windows_and_ticks_in_range_are_accepted() {
    for (length, tick, accepted) in [
        (1, 1000, false),
        (2, 1000, true),
        (MAX_WINDOW, 1000, true),
        (MAX_WINDOW + 1, 1000, false),
        (16, 99, false),
        (16, 100, true),
        (16, 2000, true),
        (16, 2001, false),
    ] {
        assert_eq!(
            VelocityWindow::new(length, tick).is_some(),
            accepted,
            "{length} {tick}"
        );
    }
}

#[test]
fn a_ramp_is_exact_once_the_window_is_full() {
    for length in [2, 3, 7, 16, 33, 64] {
        for tick in [100_u32, 1000, 2000] {
            let window = VelocityWindow::new(length, tick).expect("valid");
            let mut estimator = VelocityEstimator::new();
            let mut velocity = VelocityMmS::ZERO;
            // 1024 raw per tick = 1/64 mm per tick.
            for k in 0..200 {
                velocity = estimator.update(&window, PositionMm::from_raw(-70_000 + 1024 * k));
            }
            let exact = 1e6 / 64.0 / f64::from(tick);
            assert!(
                (velocity.to_f64() - exact).abs() < exact * 1e-6,
                "{length} {tick}"
            );
        }
    }
}

#[test]
fn on_a_parabola_the_delay_is_half_the_window() {
    let mut estimator = VelocityEstimator::new();
    let window = window(32);
    // y = 2 k² raw: the velocity per tick at k is 4k.
    for k in 0..300 {
        let velocity = estimator.update(&window, PositionMm::from_raw(2 * k * k));
        if k >= 32 {
            let delayed = 4.0 * (f64::from(k) - 15.5) * 1000.0 / 65_536.0;
            assert!((velocity.to_f64() - delayed).abs() < 1e-3, "{k}");
        }
    }
}

#[test]
fn white_noise_is_amplified_as_documented() {
    let mut state = 1_u64;
    for (length, gain) in [(8_u8, 154.0), (16, 54.0), (32, 19.1), (64, 6.77)] {
        let window = window(length);
        let mut estimator = VelocityEstimator::new();
        let (mut sum, mut position_sum) = (0.0, 0.0);
        let samples = 20_000;
        for _ in 0..samples {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            // Uniform over ±1 mm.
            let raw = i32::try_from((state >> 33) % 131_073).unwrap() - 65_536;
            let velocity = estimator
                .update(&window, PositionMm::from_raw(raw))
                .to_f64();
            sum += velocity * velocity;
            position_sum += (f64::from(raw) / 65_536.0).powi(2);
        }
        let measured = (sum / position_sum).sqrt();
        assert!(
            (measured / gain - 1.0).abs() < 0.05,
            "N = {length}: {measured}"
        );
    }
}

#[test]
fn full_scale_jumps_saturate_and_recover() {
    for length in [2, 16, 64] {
        let window = window(length);
        let mut estimator = VelocityEstimator::new();
        assert_eq!(
            estimator.update(&window, PositionMm::MIN),
            VelocityMmS::ZERO
        );
        assert_eq!(estimator.update(&window, PositionMm::MAX), VelocityMmS::MAX);
        for _ in 0..200 {
            estimator.update(&window, PositionMm::MAX);
        }
        assert_eq!(estimator.update(&window, PositionMm::MIN), VelocityMmS::MIN);
        for _ in 0..64 {
            estimator.update(&window, PositionMm::MIN);
        }
        // Integers do not drift: back to exactly nothing.
        assert_eq!(
            estimator.update(&window, PositionMm::MIN),
            VelocityMmS::ZERO
        );
    }
}

#[test]
fn one_step_of_the_position_is_seen_with_its_sign() {
    let window = window(2);
    let mut estimator = VelocityEstimator::new();
    estimator.update(&window, PositionMm::ZERO);
    assert_eq!(
        estimator.update(&window, PositionMm::from_raw(1)).raw(),
        1000
    );
    assert_eq!(estimator.update(&window, PositionMm::ZERO).raw(), -1000);
    assert_eq!(
        estimator.update(&window, PositionMm::from_raw(-1)).raw(),
        -1000
    );
    estimator.reset();
    assert_eq!(
        estimator.update(&window, PositionMm::from_int(100)),
        VelocityMmS::ZERO
    );
}

proptest! {
    #[test]
    fn recursion_equals_the_definition(
        samples in prop::collection::vec(-12_000_000_i32..12_000_000, 70..150), length in 2_u8..=64,
    ) {
        let window = window(length);
        let mut estimator = VelocityEstimator::new();
        let mut velocity = VelocityMmS::ZERO;
        for &sample in &samples {
            velocity = estimator.update(&window, PositionMm::from_raw(sample));
        }
        let limit = f64::from(i32::MAX);
        let exact = slope(&samples, usize::from(length)).clamp(-limit - 1.0, limit);
        prop_assert!((f64::from(velocity.raw()) - exact).abs() <= 0.6 + exact.abs() * 1.3e-7);
    }

    #[test]
    fn the_estimate_is_odd(samples in prop::collection::vec(-i32::MAX..=i32::MAX, 1..100)) {
        let window = window(16);
        let (mut plus, mut minus) = (VelocityEstimator::new(), VelocityEstimator::new());
        for &sample in &samples {
            let a = plus.update(&window, PositionMm::from_raw(sample)).raw();
            let b = minus.update(&window, PositionMm::from_raw(-sample)).raw();
            // The two ends of the format differ by one.
            let off = i64::from(a) + i64::from(b);
            prop_assert!(off == 0 || (off == -1 && a.max(b) == i32::MAX), "{} {}", a, b);
        }
    }
}

#[test]
fn the_hash_tells_sums_moments_and_places_apart() {
    use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
    let window = window(4);
    let hash_of = |samples: &[i32]| {
        let mut estimator = VelocityEstimator::new();
        for &sample in samples {
            estimator.update(&window, PositionMm::from_raw(sample));
        }
        BuildHasherDefault::<DefaultHasher>::default().hash_one(estimator)
    };
    let hash = hash_of(&[0, 1, 0, 0, 1]);
    assert_eq!(hash, hash_of(&[0, 1, 0, 0, 1]));
    // Another sum, another moment, and the same samples one place further on.
    assert_ne!(hash, hash_of(&[0, 1, 0, 0, 2]));
    assert_ne!(hash, hash_of(&[0, 0, 1, 0, 1]));
    assert_ne!(hash, hash_of(&[0, 0, 1, 0, 0, 1]));
}
