//! The second engine: bolero draws the inputs, under plain `cargo test`. The number of inputs is small here;
//! `BOLERO_RANDOM_ITERATIONS` and `BOLERO_RANDOM_TEST_TIME_MS` change it, as `cargo xtask deep engine` does.
//! It shrinks each failing input and prints the `BOLERO_RANDOM_SEED` that repeats it. The targets assert the
//! properties.

fn iterations(default: usize) -> usize {
    let wanted = std::env::var("BOLERO_RANDOM_ITERATIONS").ok();
    let iterations = wanted.map_or(default, |text| text.parse().expect("a number"));
    assert!(iterations > 0, "no input would be no test");
    iterations
}

macro_rules! engine {
    ($($name:ident: $iterations:literal, $length:literal;)*) => { $(
        #[test]
        fn $name() {
            bolero::check!()
                .with_iterations(iterations($iterations))
                .with_max_len($length)
                .for_each(|data: &[u8]| wheeleg_fuzz_targets::$name::run(data));
        }
    )* };
}

engine! {
    decoder: 20_000, 2_000;
    frames: 5_000, 4_000;
    parse: 20_000, 200;
    joint: 1_500, 2_000;
    wheel: 700, 2_000;
    master: 200, 1_000;
    store: 2_000, 400;
    remote: 5_000, 2_000;
}

#[cfg(feature = "sim")]
engine! {
    scenario: 2_000, 4_000;
    files: 2_000, 4_000;
    written: 500, 2_000;
    tables: 2_000, 300;
    console: 5_000, 2_000;
}
