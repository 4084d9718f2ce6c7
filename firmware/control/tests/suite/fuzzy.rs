//! Properties of the fuzzy engine and of the shipped rule bases.

use proptest::prelude::*;
use wheeleg_control::paper::fuzzy::{
    CHIP_LEVELS, FULL_LEVELS, FuzzyError, GridRules, Partition, Rule, RuleList, Triangle,
};
use wheeleg_control::paper::rules;

const SHIPPED: [(&str, GridRules<7, 7>); 2] = [("PD", rules::PD), ("ID", rules::ID)];

fn triangle(vertex: i16, left: u16, right: u16) -> Triangle {
    Triangle {
        vertex,
        left,
        right,
    }
}

/// The same rules as a list, which knows no fast path.
fn as_list(table: [[i16; 7]; 7]) -> RuleList<2, 7, 49> {
    let base = rules::from_per_mille(table).expect("valid");
    let mut rules = [Rule {
        sets: [0, 0],
        consequent: 0,
    }; 49];
    for (index, rule) in rules.iter_mut().enumerate() {
        let (i, j) = (index / 7, index % 7);
        // At the vertices of both sets the base gives the consequent itself.
        let consequent = base.infer(rules::VERTICES[i], rules::VERTICES[j]);
        *rule = Rule {
            sets: [u8::try_from(i).unwrap(), u8::try_from(j).unwrap()],
            consequent,
        };
    }
    RuleList::new([*base.first(), *base.second()], rules).expect("valid")
}

#[test]
fn at_a_vertex_the_output_is_the_consequent() {
    for (table, base) in [
        (rules::PD_PER_MILLE, rules::PD),
        (rules::ID_PER_MILLE, rules::ID),
    ] {
        for (i, row) in table.iter().enumerate() {
            for (j, &per_mille) in row.iter().enumerate() {
                let got = f64::from(base.infer(rules::VERTICES[i], rules::VERTICES[j]));
                assert!((got - f64::from(per_mille) * 32.767).abs() <= 0.5);
            }
        }
    }
}

#[test]
fn every_point_of_the_domain_is_covered_and_memberships_add_up() {
    for (name, base) in SHIPPED {
        for partition in [base.first(), base.second()] {
            assert!(partition.is_fan(), "{name}");
            for x in i16::MIN..=i16::MAX {
                let sum: u32 = (0..7).map(|i| u32::from(partition.membership(i, x))).sum();
                let full = u32::from(FULL_LEVELS);
                assert!(sum.abs_diff(full) <= 1, "{name} at {x}: {sum}");
            }
        }
    }
}

#[test]
fn membership_is_within_a_level_of_exact() {
    for levels in [CHIP_LEVELS, FULL_LEVELS] {
        for width in [1_u16, 2, 3, 63, 1000, 9830, 32_767, 65_535] {
            let sets = [triangle(-32_768, 0, width), triangle(32_767, 65_535, 0)];
            let partition = Partition::with_levels(-32_768, 32_767, sets, levels).expect("valid");
            for x in (i32::from(i16::MIN)..=i32::from(i16::MAX)).step_by(97) {
                let distance = f64::from(x + 32_768);
                let exact = (1.0 - distance / f64::from(width)).max(0.0) * f64::from(levels);
                let got = f64::from(partition.membership(0, i16::try_from(x).unwrap()));
                assert!(
                    (got - exact).abs() <= 1.0,
                    "{levels} {width} {x}: {got} {exact}"
                );
            }
        }
    }
}

#[test]
fn edges_and_zero() {
    for (name, base) in SHIPPED {
        assert_eq!(base.infer(0, 0), 0, "{name}");
        // Beyond the domain is the edge: −32 768 is one step outside.
        assert_eq!(base.infer(i16::MIN, i16::MIN), base.infer(-32_767, -32_767));
        assert_eq!(base.infer(i16::MAX, i16::MAX), 32_767, "{name}");
        assert_eq!(base.infer(i16::MIN, i16::MIN), -32_767, "{name}");
        // One step off zero: nothing jumps.
        for (a, b) in [(0, 1), (1, 0), (1, 1), (-1, 1)] {
            assert!(base.infer(a, b).abs() <= 4, "{name} {a} {b}");
        }
    }
}

#[test]
fn faulty_tables_are_refused_by_name() {
    let outside = [triangle(-10, 0, 20), triangle(11, 20, 0)];
    assert_eq!(
        Partition::new(-10, 10, outside),
        Err(FuzzyError::VertexOutsideDomain)
    );
    let order = [triangle(0, 0, 20), triangle(0, 20, 20)];
    assert_eq!(Partition::new(0, 10, order), Err(FuzzyError::VertexOrder));
    // Supports end at −10 + 9 and begin at 10 − 9: zero belongs to neither.
    let gap = [triangle(-10, 0, 10), triangle(10, 10, 0)];
    assert_eq!(Partition::new(-10, 10, gap), Err(FuzzyError::Gap));
    let touching = [triangle(-10, 0, 11), triangle(10, 10, 0)];
    assert!(Partition::new(-10, 10, touching).is_ok());
    let bare_end = [triangle(-5, 5, 20), triangle(10, 20, 0)];
    assert_eq!(Partition::new(-10, 10, bare_end), Err(FuzzyError::Gap));
    let reaching_end = [triangle(-5, 6, 20), triangle(10, 20, 0)];
    assert!(Partition::new(-10, 10, reaching_end).is_ok());
    assert_eq!(Partition::new(10, 10, touching), Err(FuzzyError::Domain));
    for levels in [0, FULL_LEVELS + 1] {
        let refused = Partition::with_levels(-10, 10, touching, levels);
        assert_eq!(refused, Err(FuzzyError::Levels));
    }
    assert_eq!(Partition::<17>::even(-100, 100), Err(FuzzyError::SetCount));
    assert_eq!(Partition::<1>::even(-100, 100), Err(FuzzyError::SetCount));
    let fine = Partition::<3>::even(-100, 100).expect("valid");
    let coarse_sets = [
        triangle(-100, 0, 100),
        triangle(0, 100, 100),
        triangle(100, 100, 0),
    ];
    let coarse = Partition::with_levels(-100, 100, coarse_sets, CHIP_LEVELS).expect("valid");
    assert_eq!(
        GridRules::new(fine, coarse, [[0; 3]; 3]),
        Err(FuzzyError::Levels)
    );
    let unknown = [Rule {
        sets: [3],
        consequent: 1,
    }];
    assert_eq!(RuleList::new([fine], unknown), Err(FuzzyError::UnknownSet));
    let five = [fine; 5];
    let rule = [Rule {
        sets: [0; 5],
        consequent: 1,
    }];
    assert_eq!(RuleList::new(five, rule), Err(FuzzyError::InputCount));
}

#[test]
fn sixteen_even_sets_keep_their_order() {
    let partition = Partition::<16>::even(i16::MIN, i16::MAX).expect("valid");
    assert!(partition.is_fan());
    for index in 0..16 {
        let vertex = -32_768 + (65_535 * index + 7) / 15;
        let at = i16::try_from(vertex).unwrap();
        assert_eq!(
            partition.membership(usize::try_from(index).unwrap(), at),
            FULL_LEVELS
        );
    }
}

proptest! {
    #[test]
    fn fast_path_equals_all_rules(a in any::<i16>(), b in any::<i16>()) {
        for (table, base) in [(rules::PD_PER_MILLE, rules::PD), (rules::ID_PER_MILLE, rules::ID)] {
            prop_assert_eq!(base.infer(a, b), as_list(table).infer([a, b]));
        }
    }

    #[test]
    fn shipped_bases_are_odd(a in -32_767_i16..=32_767, b in -32_767_i16..=32_767) {
        for (name, base) in SHIPPED {
            prop_assert_eq!(base.infer(-a, -b), -base.infer(a, b), "{}", name);
        }
    }

    #[test]
    fn any_table_is_bounded_by_its_consequents(
        table in prop::array::uniform3(prop::array::uniform3(any::<i16>())),
        middle in -32_000_i16..32_000, a in any::<i16>(), b in any::<i16>(),
    ) {
        let partition = Partition::fan([i16::MIN, middle, i16::MAX]).expect("valid");
        let base = GridRules::new(partition, partition, table).expect("valid");
        let all = table.iter().flatten();
        let (low, high) = (*all.clone().min().unwrap(), *all.max().unwrap());
        let output = base.infer(a, b);
        prop_assert!(low <= output && output <= high);
    }

    #[test]
    fn wide_tables_are_bounded_by_their_consequents(
        table in prop::array::uniform3(prop::array::uniform3(any::<i16>())),
        sides in prop::array::uniform6(20_000_u16..), a in any::<i16>(), b in any::<i16>(),
    ) {
        let [p, q, r, s, t, u] = sides;
        let sets = [triangle(-20_000, p, q), triangle(0, r, s), triangle(20_000, t, u)];
        let partition = Partition::new(-20_000, 20_000, sets).expect("valid");
        let base = GridRules::new(partition, partition, table).expect("valid");
        let all = table.iter().flatten();
        let (low, high) = (*all.clone().min().unwrap(), *all.max().unwrap());
        let output = base.infer(a, b);
        prop_assert!(low <= output && output <= high);
    }
}

/// The weighted mean with AND = min is not monotone between the vertices even for
/// a monotone table, so the table itself is held to it, and the surface to a bound.
#[test]
fn shipped_tables_are_odd_and_do_not_fall() {
    for (name, table) in [("PD", rules::PD_PER_MILLE), ("ID", rules::ID_PER_MILLE)] {
        for i in 0..7 {
            for j in 0..7 {
                assert_eq!(table[i][j], -table[6 - i][6 - j], "{name} {i} {j}");
                assert!(
                    i == 0 || table[i][j] >= table[i - 1][j],
                    "{name} falls in e at {i} {j}"
                );
                assert!(
                    j == 0 || table[i][j] >= table[i][j - 1],
                    "{name} falls in rate at {i} {j}"
                );
            }
        }
    }
}

#[test]
fn shipped_surfaces_fall_by_no_more_than_a_few_per_cent() {
    for (name, base) in SHIPPED {
        let mut deepest = 0;
        for fixed in (-32_767..=32_767_i16).step_by(1311) {
            let (mut top_a, mut top_b) = (i32::MIN, i32::MIN);
            for moving in (-32_767..=32_767_i16).step_by(257) {
                let a = i32::from(base.infer(moving, fixed));
                let b = i32::from(base.infer(fixed, moving));
                (top_a, top_b) = (top_a.max(a), top_b.max(b));
                deepest = deepest.max(top_a - a).max(top_b - b);
            }
        }
        println!("{name}: deepest dip {deepest} of 32767");
        assert!(deepest < 700, "{name}: {deepest}");
    }
}
