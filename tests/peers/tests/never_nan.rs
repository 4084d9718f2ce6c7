//! Any bits as input of the engine: a finite answer or a typed refusal, never NaN, never a panic.

#[path = "../../../host-sim/plant/tests/suite/odd.rs"]
mod odd;

use odd::{finite, lengths, named, number, numbers};
use proptest::prelude::*;
use wheeleg_peers::chain::reference::{ROBOT14, RPP, RPR};
use wheeleg_peers::chain::{ChainLeg, FloatingState};
use wheeleg_plant::dynamics::{DynamicsError, RobotDynamicsParams};

/// A finite answer, or a named refusal.
fn right<const N: usize>(answer: Result<[f64; N], DynamicsError>) -> Result<(), TestCaseError> {
    match answer {
        Ok(answer) => prop_assert!(finite(&answer), "{answer:?}"),
        Err(error) => prop_assert!(named(&error), "{error:?}"),
    }
    Ok(())
}

fn right_matrix<const N: usize>(
    answer: Result<[[f64; N]; N], DynamicsError>,
) -> Result<(), TestCaseError> {
    let marked = |row: [f64; N]| if finite(&row) { 0.0 } else { f64::NAN };
    right(answer.map(|rows| rows.map(marked)))
}

/// Mostly ordinary: of many numbers at once only a few are spoilt.
fn seldom() -> impl Strategy<Value = f64> {
    prop_oneof![15 => -1.0..1.0, 1 => number()]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn chain_engine(q in numbers::<3>(), v in numbers::<3>(), f in numbers::<3>(), g in numbers::<3>()) {
        let g = g.map(|x| 10.0 * x);
        for at in 0..4 {
            // All of them odd, or one odd argument among ordinary ones.
            let pick = |k: usize, odd: [f64; 3]| if at == 0 || at == k { odd } else { [0.1, 0.3, -0.2] };
            let (q, v, f) = (pick(1, q), pick(2, v), pick(3, f));
            right(RPP.inverse(&q, &v, &f, &g))?;
            right(RPP.forward(&q, &v, &f, &g))?;
            right(RPR.inverse(&q, &v, &f, &g))?;
            right(RPR.forward(&q, &v, &f, &g))?;
            right_matrix(RPP.mass_matrix(&q))?;
            right_matrix(RPR.mass_matrix(&q))?;
        }
    }

    #[test]
    fn chain_engine_on_a_free_base(
        turn in proptest::array::uniform4(seldom()),
        joints in proptest::array::uniform8(seldom()),
        rates in proptest::array::uniform14(seldom()),
        f in proptest::array::uniform14(seldom()),
        g in proptest::array::uniform3(seldom()),
    ) {
        let norm = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
        let state = FloatingState {
            quaternion: turn.map(|x| x / norm),
            joints,
            rates,
        };
        right(ROBOT14.inverse(&state, &f, &g))?;
        right(ROBOT14.forward(&state, &f, &g))?;
        right_matrix(ROBOT14.mass_matrix(&joints))?;
    }

    #[test]
    fn leg_on_the_chain_engine(q in lengths(), v in numbers::<3>(), f in numbers::<3>(), g in numbers::<3>(), c in numbers::<3>()) {
        let p = RobotDynamicsParams::wheeleg_2003().half();
        let leg = ChainLeg::new(p.leg_parameters(), &p.leg_bodies, [20.0, 15.0, 15.0]).unwrap();
        right(leg.inverse(&q, &v, &f, &g, &c))?;
        right(leg.forward(&q, &v, &f, &g, &c))?;
        right_matrix(leg.inertia(&q))?;
        let slow = [0.1, -0.2, 0.3];
        right(leg.inverse(&q, &slow, &slow, &slow, &slow))?;
        right(leg.forward(&q, &slow, &slow, &slow, &slow))?;
    }
}
