//! What a quick look at a body calls clear does not touch, and it is so for most that do not.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::terrain::{Disc, Solid, Surface};

use crate::rocks::{rock, vector};

/// Half the width of a wheel, m.
const SIDE_M: f64 = 0.04;

/// How many balls and wheels were apart from a body, and of how many a quick look told it.
#[derive(Default)]
struct Looks {
    balls: [u32; 2],
    wheels: [u32; 2],
}

impl Looks {
    /// A ball of this radius in the middle of a wheel, and the wheel, against the discs that it is made of.
    fn look(&mut self, body: &(impl Surface + std::fmt::Debug), radius_m: f64, disc: &Disc) {
        let place = &disc.centre_m;
        let apart = body.to_point(place).distance_m > radius_m;
        let clear = body.is_clear_of_ball(place, radius_m);
        assert!(apart || !clear, "{body:?} {place:?}");
        self.balls[0] += u32::from(apart);
        self.balls[1] += u32::from(clear);
        let mut nears = (-8..=8).map(|k| {
            body.to_disc(&Disc {
                centre_m: place + f64::from(k) / 8.0 * SIDE_M * disc.axis,
                ..*disc
            })
        });
        let apart = nears.all(|near| near.is_none_or(|near| near.distance_m > 0.0));
        let clear = body.is_clear_of_wheel(disc, SIDE_M);
        assert!(apart || !clear, "{body:?} {disc:?}");
        self.wheels[0] += u32::from(apart);
        self.wheels[1] += u32::from(clear);
    }

    /// At least so many tenths of them were told.
    fn tell(&self, tenths: u32) {
        for [apart, clear] in [self.balls, self.wheels] {
            assert!(10 * clear > tenths * apart, "{clear} of {apart}");
        }
    }
}

#[test]
fn a_rock_misses_no_touch() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut looks = Looks::default();
    for _ in 0..3000 {
        let (rock, [centre, _], _) = rock(&mut rng);
        let disc = Disc {
            centre_m: centre + vector(&mut rng, -0.4, 0.4),
            axis: vector(&mut rng, -1.0, 1.0).normalize(),
            radius_m: 0.15,
        };
        looks.look(&rock, disc.radius_m, &disc);
    }
    looks.tell(8);
}

#[test]
fn a_block_misses_no_touch() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut looks = Looks::default();
    for _ in 0..3000 {
        let mut within = |from: f64, to: f64| rng.random_range(from..to);
        let half_m = [within(0.05, 0.3), within(0.05, 0.3)];
        let block = Solid::block([0.0; 2], half_m, within(0.0, 6.0), [-0.5, 0.1]);
        let axis = Vector3::new(within(-1.0, 1.0), within(-1.0, 1.0), within(-0.5, 0.5));
        let disc = Disc {
            centre_m: Vector3::new(within(-0.6, 0.6), within(-0.6, 0.6), within(0.0, 0.4)),
            axis: axis.normalize(),
            radius_m: 0.15,
        };
        looks.look(&block, 0.02, &disc);
    }
    looks.tell(7);
}
