//! The Sobol sequence in Gray-code order with random access to any point, and with a digital shift.
//!
//! Point n is the exclusive or of the direction numbers at the set bits of n's Gray code.

use sobol::Sobol;
use sobol::params::JoeKuoD6;

use crate::CampaignError;

/// Dimensions of the small and the large table of direction numbers.
const DIMENSIONS: [usize; 2] = [100, 1000];

/// Direction numbers of one factor, and its shift.
pub(super) struct Directions {
    numbers: Vec<u64>,
    shift: u64,
}

/// Direction numbers of Joe and Kuo (2008, their table D6) for the factors of the points, in this order.
pub(super) fn directions<'a>(
    root: u64,
    factors: impl Iterator<Item = (&'a str, u64)>,
) -> Result<Vec<Directions>, CampaignError> {
    let factors: Vec<(&str, u64)> = factors.collect();
    let table = match factors.len() {
        n if n <= DIMENSIONS[0] => JoeKuoD6::minimal(),
        n if n <= DIMENSIONS[1] => JoeKuoD6::standard(),
        n => {
            return Err(CampaignError::refused(
                format!(
                    "the drawn factors take {n} dimensions: a Sobol sequence has 1 to 1000 here, and \
                     \"saltelli\" takes two for each factor"
                ),
                "use `sampler = \"random\"`",
            ));
        }
    };
    let bits = Some(u64::BITS as usize);
    let numbers = Sobol::<u64>::init_direction_vals::<u32>(factors.len(), 64, &table);
    debug_assert_eq!(
        numbers.first().map(Vec::len),
        bits.filter(|_| !factors.is_empty())
    );
    let directions = numbers.into_iter().zip(factors);
    Ok(directions
        .map(|(numbers, (factor, point))| Directions {
            numbers,
            shift: super::first(super::hash(root, "sobol shift", factor, point)),
        })
        .collect())
}

impl Directions {
    /// Coordinate of a point, as a binary fraction of 64 bits.
    fn point(&self, number: u64) -> u64 {
        let gray = number ^ (number >> 1);
        let set = (0..u64::BITS).filter(|bit| gray >> bit & 1 == 1);
        set.fold(0, |sum, bit| sum ^ self.numbers[bit as usize])
    }

    /// The shifted coordinate of a point.
    pub(super) fn shifted(&self, number: u64) -> u64 {
        self.point(number) ^ self.shift
    }
}

#[cfg(test)]
mod tests {
    use super::directions;

    fn points(dimensions: usize, numbers: std::ops::Range<u64>) -> Vec<Vec<f64>> {
        let names = vec![("x", 0); dimensions];
        let all = directions(1, names.into_iter()).expect("so many dimensions");
        let share = |bits: u64| bits as f64 / 2_f64.powi(64);
        numbers
            .map(|n| all.iter().map(|d| share(d.point(n))).collect())
            .collect()
    }

    /// Reference values from `scipy.stats.qmc.Sobol(d, scramble=False)` of SciPy 1.17.1.
    #[test]
    fn unshifted_points_are_those_of_scipy() {
        let first = [
            [0.0, 0.0, 0.0],
            [0.5; 3],
            [0.75, 0.25, 0.25],
            [0.25, 0.75, 0.75],
        ];
        assert_eq!(points(3, 0..4), first);
    }

    /// Each dimension alone, and every pair of the first ones, fills a grid of equal cells.
    #[test]
    fn points_are_spread_evenly() {
        let points = points(12, 0..256);
        for a in 0..12 {
            let mut cells: Vec<u64> = points.iter().map(|p| (p[a] * 256.0) as u64).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..256).collect::<Vec<_>>(), "dimension {a}");
        }
        let mut pairs: Vec<(u64, u64)> = points
            .iter()
            .map(|p| ((p[0] * 16.0) as u64, (p[1] * 16.0) as u64))
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        assert_eq!(pairs.len(), 256);
    }

    #[test]
    fn too_many_factors_are_refused() {
        let of = |count: usize| directions(1, vec![("x", 0); count].into_iter());
        let error = of(1001).err().expect("refused").to_string();
        assert!(error.contains("1001") && error.contains("1000"), "{error}");
        assert_eq!(of(200).expect("the larger table").len(), 200);
    }
}
