//! Timers as the images configure them.

use super::registers::{ARR, BDTR, CCER, CCMR1, CCR1, CCR4, CNT, CR1, CR2, DIER, EGR, PSC, SMCR};
use super::*;

fn tick() -> Tim {
    let mut tim = Tim::new(Kind::Advanced);
    for (register, value) in [
        (PSC, 169),
        (ARR, 999),
        (CCMR1, 0x6868),
        (CCER, 0x1111),
        (CR2, 0x20),
        (EGR, 1),
        (BDTR, MOE),
        (CR1, 0x81),
    ] {
        tim.write(register, value, 0).expect("modelled");
    }
    tim
}

#[test]
fn a_preloaded_compare_value_acts_from_the_next_edge() {
    let mut tim = tick();
    tim.write(CCR1, 350, 10).expect("modelled");
    assert_eq!(tim.high_counts(0), (0, 1000));
    assert_eq!(tim.next(), Some((170_000, Event::Update)));
    assert_eq!(tim.count(169_999), 999);
    tim.happen(170_000, Event::Update);
    assert_eq!(tim.high_counts(0), (350, 1000));
    tim.write(CCER, 0x1113, 170_001).expect("modelled");
    assert_eq!(tim.high_counts(0), (650, 1000), "inverted");
    tim.write(BDTR, 0, 170_001).expect("modelled");
    assert_eq!(tim.high_counts(0), (0, 1000), "main output off");
}

#[test]
fn a_free_running_counter_matches_once_a_round() {
    let mut tim = Tim::new(Kind::Wide);
    tim.write(PSC, 169, 0).expect("modelled");
    tim.write(EGR, 1, 0).expect("modelled");
    tim.write(CNT, (-1000_i32) as u32, 0).expect("modelled");
    tim.write(DIER, 1 << 12, 0).expect("modelled");
    tim.write(CR1, 1, 0).expect("modelled");
    tim.write(CCR4, 5, 1).expect("modelled");
    assert_eq!(tim.next(), Some((170 * 1005, Event::Match(3))));
    assert_eq!(tim.cycle_of(5), 170 * 1005);
    assert_eq!(tim.count(170 * 1000), 0);
    tim.happen(170 * 1005, Event::Match(3));
    assert!(tim.next().is_some_and(|(at, _)| at > 1 << 39));
}

#[test]
fn the_encoder_counts_both_ways_and_its_polarity_turns_it() {
    let mut tim = Tim::new(Kind::General);
    tim.write(SMCR, 3, 0).expect("modelled");
    tim.write(CCER, 2, 0).expect("modelled");
    tim.turn(5);
    assert_eq!(tim.count(0), 5);
    tim.turn(-3);
    assert_eq!(tim.count(0), 0xFFFD);
    tim.write(CCER, 0, 0).expect("modelled");
    tim.write(CNT, 0, 0).expect("modelled");
    tim.turn(0);
    assert_eq!(tim.count(0), 0xFFFD, "turned round, three back from −3");
}

#[test]
fn a_one_shot_ends_itself() {
    let mut tim = Tim::new(Kind::Small);
    for (register, value) in [
        (PSC, 169),
        (ARR, 13),
        (CCR1, 1),
        (CCMR1, 0x70),
        (CCER, 1),
        (EGR, 1),
        (BDTR, MOE),
        (SMCR, 0x16),
        (CR1, 8),
    ] {
        tim.write(register, value, 0).expect("modelled");
    }
    assert!(tim.waits_for(1));
    tim.trigger(0, 1000);
    assert!(!tim.runs(), "another input");
    tim.trigger(1, 1000);
    let pulse = Some((1170, 1000 + 14 * 170));
    assert_eq!(tim.pulse(tim.started_at()), pulse);
    // The next trigger is disabled; the current pulse stays as it is.
    tim.write(SMCR, 0, 1000 + 5 * 170 + 7).expect("modelled");
    assert_eq!(tim.pulse(tim.started_at()), pulse);
    assert_eq!(tim.next(), Some((1000 + 14 * 170, Event::Update)));
    tim.happen(1000 + 14 * 170, Event::Update);
    assert!(!tim.runs());
}

#[test]
fn settings_that_are_not_modelled_are_refused() {
    let mut tim = Tim::new(Kind::Advanced);
    // Toggle on match, and an asymmetric mode whose bit is far from the others.
    assert!(tim.write(CCMR1, 0x30, 0).is_err());
    assert!(tim.write(CCMR1, 1 << 24 | 0x6000, 0).is_err());
    tim.write(CCMR1, 0x7060, 0).expect("modelled");
    // An inverted second signal would reverse the direction of an encoder.
    let mut encoder = Tim::new(Kind::General);
    encoder.write(SMCR, 3, 0).expect("modelled");
    assert!(encoder.write(CCER, 0x20, 0).is_err());
    encoder.write(SMCR, 0, 0).expect("modelled");
    encoder.write(CCER, 0x20, 0).expect("modelled");
    assert!(encoder.write(SMCR, 3, 0).is_err());
}
