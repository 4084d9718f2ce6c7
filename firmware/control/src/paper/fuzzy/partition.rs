//! The triangular sets of one input.

use super::FuzzyError;

/// Largest number of sets of one input (ST52x301 data sheet p. 1).
pub const MAX_SETS: usize = 16;

/// Membership levels of the default resolution: 14 bits. Chosen so that four
/// rules with 16-bit consequents sum in 32 bits.
pub const FULL_LEVELS: u16 = 1 << 14;

/// Membership levels of the chip: 0…15 (ST52F510 data sheet p. 58).
pub const CHIP_LEVELS: u16 = 15;

/// A triangular set, as the chip stores it: vertex, left and right semi-base.
///
/// Membership is full at the vertex and falls linearly to zero over the semi-base on each side. A semi-base of 0 is a
/// vertical side; with the vertex at an end of the domain this makes the outermost set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Triangle {
    /// Where membership is full.
    pub vertex: i16,
    /// Width of the rising side, below the vertex.
    pub left: u16,
    /// Width of the falling side, above the vertex.
    pub right: u16,
}

/// One side of a triangle: its width (at least 1) and the fall of membership
/// per unit of distance, in levels × 2^16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Side {
    width: u32,
    slope: u32,
}

impl Side {
    const fn new(width: u16, levels: u16) -> Self {
        // A vertical side: only distance 0 belongs to the set.
        let width = if width == 0 { 1 } else { width as u32 };
        let scaled = (levels as u32).wrapping_shl(16);
        let biased = scaled.saturating_add(width.wrapping_shr(1));
        let slope = match biased.checked_div(width) {
            Some(slope) => slope,
            None => 0,
        };
        Self { width, slope }
    }

    /// Membership at `distance` from the vertex. The product is at most
    /// levels × 2^16 + width / 2 <= 2^30 + 2^15.
    #[inline]
    fn level(self, distance: u32, levels: u32) -> u32 {
        // Beyond the side, its end is used: the same value without a branch. There the fall is `levels` and never more,
        // because width × slope is levels × 2^16 within half a width.
        let distance = distance.min(self.width);
        let fall = distance
            .wrapping_mul(self.slope)
            .wrapping_add(1 << 15)
            .wrapping_shr(16);
        levels.wrapping_sub(fall)
    }
}

/// The sets of one input: at most `N`, in order of their vertices.
///
/// Construction checks that the domain is covered without a gap, so some rule
/// of a full table always fires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Partition<const N: usize> {
    low: i16,
    high: i16,
    levels: u16,
    len: u8,
    fan: bool,
    vertices: [i16; N],
    left: [Side; N],
    right: [Side; N],
}

/// Two neighbouring sets and their memberships at a point: the only sets that are active in a fan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    pub(super) index: usize,
    pub(super) lower: u32,
    pub(super) upper: u32,
}

impl<const N: usize> Partition<N> {
    /// A partition of `low..=high` into `sets`, with [`FULL_LEVELS`].
    ///
    /// # Errors
    /// See [`FuzzyError`].
    pub const fn new(low: i16, high: i16, sets: [Triangle; N]) -> Result<Self, FuzzyError> {
        Self::with_levels(low, high, sets, FULL_LEVELS)
    }

    /// As [`Partition::new`], with a chosen number of membership levels.
    ///
    /// # Errors
    /// See [`FuzzyError`].
    pub const fn with_levels(
        low: i16,
        high: i16,
        sets: [Triangle; N],
        levels: u16,
    ) -> Result<Self, FuzzyError> {
        Self::with_len(low, high, sets, N, levels)
    }

    /// As [`Partition::with_levels`], using only the first `len` sets: inputs of one [`super::RuleList`] may have
    /// different numbers of sets.
    ///
    /// # Errors
    /// See [`FuzzyError`].
    #[allow(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        reason = "`const fn` has no iterators; `i < len <= N` is checked first, and the tests and every shipped table evaluate it at compile time"
    )]
    pub const fn with_len(
        low: i16,
        high: i16,
        sets: [Triangle; N],
        len: usize,
        levels: u16,
    ) -> Result<Self, FuzzyError> {
        if len == 0 || len > N || len > MAX_SETS {
            return Err(FuzzyError::SetCount);
        }
        if low >= high {
            return Err(FuzzyError::Domain);
        }
        if levels == 0 || levels > FULL_LEVELS {
            return Err(FuzzyError::Levels);
        }
        let mut vertices = [high; N];
        let mut left = [Side::new(0, levels); N];
        let mut right = [Side::new(0, levels); N];
        let mut fan = len >= 2;
        let mut i = 0;
        while i < len {
            let set = sets[i];
            if set.vertex < low || set.vertex > high {
                return Err(FuzzyError::VertexOutsideDomain);
            }
            vertices[i] = set.vertex;
            left[i] = Side::new(set.left, levels);
            right[i] = Side::new(set.right, levels);
            if i > 0 {
                let previous = sets[i - 1];
                let distance = set.vertex as i32 - previous.vertex as i32;
                if distance <= 0 {
                    return Err(FuzzyError::VertexOrder);
                }
                // The last point that the lower set reaches and the first that
                // the upper one reaches must at least be neighbours.
                let reach = right[i - 1].width as i32 - 1 + left[i].width as i32 - 1;
                if reach < distance - 1 {
                    return Err(FuzzyError::Gap);
                }
                fan = fan
                    && right[i - 1].width as i32 <= distance
                    && left[i].width as i32 <= distance;
            }
            i += 1;
        }
        let first = vertices[0] as i32 - left[0].width as i32;
        let last = vertices[len - 1] as i32 + right[len - 1].width as i32;
        if first >= low as i32 || last <= high as i32 {
            return Err(FuzzyError::Gap);
        }
        // For the fast path only one set may be active below the first vertex and above the last; the pair search needs
        // x between two vertices.
        fan = fan && vertices[0] == low && vertices[len - 1] == high;
        Ok(Self {
            low,
            high,
            levels,
            len: len as u8,
            fan,
            vertices,
            left,
            right,
        })
    }

    /// Evenly spaced sets that cross at half membership, from `low` to `high`. The spacing is rounded to whole units
    /// where the domain does not divide evenly.
    ///
    /// # Errors
    /// See [`FuzzyError`]; `N` must be at least 2.
    #[allow(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        reason = "`const fn` has no iterators; `i < N`, and N - 1 >= 1 is checked first"
    )]
    pub const fn even(low: i16, high: i16) -> Result<Self, FuzzyError> {
        if N < 2 || N > MAX_SETS {
            return Err(FuzzyError::SetCount);
        }
        if low >= high {
            return Err(FuzzyError::Domain);
        }
        let mut vertices = [low; N];
        let span = high as i32 - low as i32;
        let steps = N as i32 - 1;
        let mut i = 0;
        while i < N {
            vertices[i] = (low as i32 + (span * i as i32 + steps / 2) / steps) as i16;
            i += 1;
        }
        Self::fan(vertices)
    }

    /// Sets whose sides reach exactly to the neighbouring vertices, so that memberships add up to one. The domain runs
    /// from the first to the last vertex.
    ///
    /// # Errors
    /// See [`FuzzyError`]; `N` must be at least 2.
    #[allow(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        reason = "`const fn` has no iterators; `i < N`, and N >= 2 is checked first"
    )]
    pub const fn fan(vertices: [i16; N]) -> Result<Self, FuzzyError> {
        if N < 2 || N > MAX_SETS {
            return Err(FuzzyError::SetCount);
        }
        let mut sets = [Triangle {
            vertex: 0,
            left: 0,
            right: 0,
        }; N];
        let mut i = 0;
        while i < N {
            let vertex = vertices[i] as i32;
            let left = if i == 0 {
                0
            } else {
                vertex - vertices[i - 1] as i32
            };
            let right = if i + 1 == N {
                0
            } else {
                vertices[i + 1] as i32 - vertex
            };
            if left < 0 || right < 0 {
                return Err(FuzzyError::VertexOrder);
            }
            sets[i] = Triangle {
                vertex: vertices[i],
                left: left as u16,
                right: right as u16,
            };
            i += 1;
        }
        Self::new(vertices[0], vertices[N - 1], sets)
    }

    /// Number of membership levels.
    #[must_use]
    pub const fn levels(&self) -> u16 {
        self.levels
    }

    /// Number of sets.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Always false: a partition has at least one set.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether at most two neighbouring sets are active anywhere in the domain.
    #[must_use]
    pub const fn is_fan(&self) -> bool {
        self.fan
    }

    /// The input limited to the domain.
    #[inline]
    #[must_use]
    pub const fn limit(&self, input: i16) -> i16 {
        if input < self.low {
            self.low
        } else if input > self.high {
            self.high
        } else {
            input
        }
    }

    /// Membership of `input`, limited to the domain, in set `index`: 0…levels. Returns 0 for an index beyond the last
    /// set.
    #[inline]
    #[must_use]
    pub fn membership(&self, index: usize, input: i16) -> u16 {
        if index >= self.len() {
            return 0;
        }
        let (Some(&vertex), Some(&left), Some(&right)) = (
            self.vertices.get(index),
            self.left.get(index),
            self.right.get(index),
        ) else {
            return 0;
        };
        let offset = i32::from(self.limit(input)).wrapping_sub(i32::from(vertex));
        let side = if offset < 0 { left } else { right };
        // At most `levels`, which is a `u16`.
        side.level(offset.unsigned_abs(), u32::from(self.levels)) as u16
    }

    /// Memberships of `input` in all sets. It exists once and is not unrolled, for rule bases whose cost does not
    /// matter.
    #[inline(never)]
    pub(super) fn memberships(&self, input: i16, levels: &mut [u16]) {
        // A range instead of `enumerate`, whose counter has an overflow check that leaves a panic in the image.
        for (index, level) in (0..N).zip(levels) {
            *level = self.membership(index, input);
        }
    }

    /// The two sets around `input` in a fan of all `N` sets.
    #[inline]
    pub(super) fn pair(&self, input: i16) -> Pair {
        // Binary search for the last inner vertex at or below the input. The bounds depend on `N` alone, so that the
        // loop unrolls and the look-ups below need no check.
        let (mut index, mut rest) = (0_usize, N.saturating_sub(2));
        while rest > 0 {
            // Whether the middle one of the `rest` vertices behind `index` is at or below the input.
            let half = rest.wrapping_add(1).wrapping_shr(1);
            let middle = index.wrapping_add(half);
            let vertex = self.vertices.get(middle).copied().unwrap_or(i16::MAX);
            if input >= vertex {
                index = middle;
            }
            rest = rest.wrapping_sub(half);
        }
        let index = index.min(N.saturating_sub(2));
        let next = index.wrapping_add(1);
        let levels = u32::from(self.levels);
        let sides = (
            self.vertices.get(index),
            self.right.get(index),
            self.vertices.get(next),
            self.left.get(next),
        );
        let (Some(&low), Some(&fall), Some(&high), Some(&rise)) = sides else {
            return Pair {
                index,
                lower: 0,
                upper: 0,
            };
        };
        // Beyond the domain one distance is negative and counts as zero; the other is beyond the side, which reaches no
        // further than the neighbour.
        let distance = |from: i16, to: i16| i32::from(to).wrapping_sub(i32::from(from)).max(0);
        let lower = fall.level(distance(low, input) as u32, levels);
        let upper = rise.level(distance(input, high) as u32, levels);
        Pair {
            index,
            lower,
            upper,
        }
    }
}
