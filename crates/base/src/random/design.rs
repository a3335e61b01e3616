//! How the members of an ensemble are spread over the unit cube of the numbers that are drawn: at random, or evenly.
//!
//! In every design a coordinate is a pure function of [`DrawAddress`]: seed, cell, rank of the member and place. No
//! member needs to know the others, so any shard or single member has the coordinates that it has in the whole.
//!
//! **Sobol.** Point number j of Sobol's sequence with the direction numbers of Joe and Kuo (new-joe-kuo-6.21201, SIAM
//! J. Sci. Comput. 30, 2008), for j the rank of the member in its cell, under Owen's nested uniform scrambling (1995):
//! each binary digit is flipped by a random bit that belongs to the digits before it. The first 2^k members of a cell
//! are a net, and each alone is uniform. Beyond its 32 digits a coordinate is random.
//!
//! **Latin hypercube.** (π(j) + u)/N for member j of N, with a random permutation π for each place: one member in each
//! of N slices. π is a Feistel network on the smallest even number of bits that holds N, applied until the result is
//! below N.

use serde::{Deserialize, Serialize};

use super::{Stream, distribution::SMALLEST, philox};

/// Attempts of a [`Stream`] that no perturbation reaches: draws of distributions, digits of a scrambling, and rounds of
/// a permutation.
const DRAWS: u32 = u32::MAX;
const DIGITS: u32 = u32::MAX - 1;
const ROUNDS: u32 = u32::MAX - 2;
/// Rounds of a Feistel network: four are pseudo-random, more cost little.
const FEISTEL_ROUNDS: u32 = 8;
/// Binary digits of a Sobol point.
const BITS: u32 = 32;
/// Largest number of coordinates of a Sobol point.
pub const MAX_SOBOL: usize = 1 + JOE_KUO.len();

/// Degree, coefficients of the primitive polynomial and first direction numbers of the coordinates from the second on.
#[rustfmt::skip]
const JOE_KUO: [(u32, u32, [u32; 7]); 20] = [
    (1, 0, [1, 0, 0, 0, 0, 0, 0]),      (2, 1, [1, 3, 0, 0, 0, 0, 0]),      (3, 1, [1, 3, 1, 0, 0, 0, 0]),
    (3, 2, [1, 1, 1, 0, 0, 0, 0]),      (4, 1, [1, 1, 3, 3, 0, 0, 0]),      (4, 4, [1, 3, 5, 13, 0, 0, 0]),
    (5, 2, [1, 1, 5, 5, 17, 0, 0]),     (5, 4, [1, 1, 5, 5, 5, 0, 0]),      (5, 7, [1, 1, 7, 11, 19, 0, 0]),
    (5, 11, [1, 1, 5, 1, 1, 0, 0]),     (5, 13, [1, 1, 1, 3, 11, 0, 0]),    (5, 14, [1, 3, 5, 5, 31, 0, 0]),
    (6, 1, [1, 3, 3, 9, 7, 49, 0]),     (6, 13, [1, 1, 1, 15, 21, 21, 0]),  (6, 16, [1, 3, 1, 13, 27, 49, 0]),
    (6, 19, [1, 1, 1, 15, 7, 5, 0]),    (6, 22, [1, 3, 1, 15, 13, 25, 0]),  (6, 25, [1, 1, 5, 5, 19, 61, 0]),
    (7, 1, [1, 3, 7, 11, 23, 15, 103]), (7, 4, [1, 3, 7, 13, 13, 15, 69]),
];

/// How the members are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Design {
    /// Independently of each other.
    #[default]
    Random,
    /// As a scrambled Sobol sequence.
    Sobol,
    /// As a Latin hypercube over the members of a cell.
    Lhs,
}

/// Where a number is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawAddress {
    /// Seed of the ensemble.
    pub seed: u64,
    /// Members of a cell.
    pub members: u64,
    /// The member, counted over all cells; a cell has `members` of them.
    pub member: u64,
    /// Key and place in its value, as one number below 2²⁶.
    pub place: u32,
    /// Rank of the place among all that are drawn.
    pub coordinate: u32,
}

impl Design {
    /// Its name in flags and files.
    pub fn name(self) -> &'static str {
        match self {
            Design::Random => "random",
            Design::Sobol => "sobol",
            Design::Lhs => "lhs",
        }
    }

    /// Whether it is the default.
    pub fn is_random(&self) -> bool {
        *self == Design::Random
    }

    /// The uniform number in (0, 1) of an address.
    pub fn uniform(self, at: &DrawAddress) -> f64 {
        let [random, _] = Stream::new(at.seed, at.member, DRAWS).uniforms(at.place);
        let members = at.members.max(1);
        let (cell, rank) = ((at.member / members) as u32, at.member % members);
        let u = match self {
            Design::Random => random,
            Design::Sobol => {
                let digits = scrambled(sobol(rank as u32, at.coordinate), at.seed, cell, at.coordinate);
                (f64::from(digits) + random) / 2_f64.powi(BITS as i32)
            }
            Design::Lhs => (permuted(rank, members, at.seed, cell, at.place) as f64 + random) / members as f64,
        };
        u.clamp(SMALLEST, 1.0 - SMALLEST)
    }
}

/// Coordinate `coordinate` of point `index` of Sobol's sequence, times 2³².
fn sobol(index: u32, coordinate: u32) -> u32 {
    let directions = directions(coordinate);
    (0..BITS).filter(|bit| index >> bit & 1 == 1).fold(0, |point, bit| point ^ directions[bit as usize])
}

fn directions(coordinate: u32) -> [u32; BITS as usize] {
    let mut v = [0_u32; BITS as usize];
    let Some((degree, coefficients, first)) = coordinate.checked_sub(1).and_then(|i| JOE_KUO.get(i as usize)) else {
        // Van der Corput's sequence.
        v.iter_mut().enumerate().for_each(|(i, v)| *v = 1 << (31 - i));
        return v;
    };
    let s = *degree as usize;
    for i in 0..v.len() {
        v[i] = match first.get(i).filter(|_| i < s) {
            Some(m) => m << (31 - i),
            None => {
                let inner = (1..s).filter(|k| coefficients >> (s - 1 - k) & 1 == 1);
                inner.fold(v[i - s] ^ v[i - s] >> s, |sum, k| sum ^ v[i - k])
            }
        };
    }
    v
}

/// `digits` with each flipped by the random bit of those before it.
fn scrambled(digits: u32, seed: u64, cell: u32, coordinate: u32) -> u32 {
    let key = [seed as u32, (seed >> 32) as u32];
    (0..BITS).fold(digits, |all, place| {
        let before = digits.checked_shr(BITS - place).unwrap_or(0);
        let [random, ..] = philox([coordinate << 6 | place, DIGITS, before, cell], key);
        all ^ (random & 1) << (BITS - 1 - place)
    })
}

/// The image of `rank` under a permutation of the numbers below `count`.
fn permuted(rank: u64, count: u64, seed: u64, cell: u32, place: u32) -> u64 {
    let key = [seed as u32, (seed >> 32) as u32];
    let bits = (u64::BITS - count.saturating_sub(1).leading_zeros()).max(2).div_ceil(2);
    let mask = (1_u64 << bits) - 1;
    let once = |value: u64| {
        let (left, right) = (0..FEISTEL_ROUNDS).fold((value >> bits, value & mask), |(left, right), round| {
            let [a, b, ..] = philox([place << 4 | round, ROUNDS, right as u32, cell], key);
            (right, left ^ (u64::from(b) << 32 | u64::from(a)) & mask)
        });
        left << bits | right
    };
    // It is a permutation of all numbers of these bits: the walk comes back to those below `count`.
    let mut image = once(rank);
    while image >= count {
        image = once(image);
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[rustfmt::skip]
    const SCIPY: [u32; MAX_SOBOL] = [
        398458880, 692060160, 1933574144, 3904897024, 4265607168, 700448768, 71303168, 2747269120, 4290772992,
        524288000, 994050048, 4240441344, 599785472, 4005560320, 3779067904, 71303168, 2864709632, 1858076672,
        3275751424, 1933574144, 1128267776,
    ];

    fn points(design: Design, seed: u64, members: u64, coordinates: u32) -> Vec<Vec<f64>> {
        let at = |member, place| DrawAddress { seed, members, member, place: 7 * place, coordinate: place };
        let point = |member| (0..coordinates).map(|place| design.uniform(&at(member, place))).collect();
        (0..members).map(point).collect()
    }

    #[test]
    fn the_sequence_is_that_of_joe_and_kuo() {
        // Point 1000 of scipy.stats.qmc.Sobol(21, scramble=False, bits=32).
        let found: Vec<u32> = (0..MAX_SOBOL as u32).map(|coordinate| sobol(1000, coordinate)).collect();
        assert_eq!(found, SCIPY);
    }

    #[test]
    fn the_first_points_of_a_power_of_two_are_one_in_each_slice_and_in_each_square_of_the_first_two() {
        let all = points(Design::Sobol, 5, 256, MAX_SOBOL as u32);
        for coordinate in 0..MAX_SOBOL {
            let mut slices: Vec<usize> = all.iter().map(|point| (256.0 * point[coordinate]) as usize).collect();
            slices.sort_unstable();
            assert!(slices.into_iter().eq(0..256), "seed 5: coordinate {coordinate}");
        }
        let mut squares: Vec<[usize; 2]> = all.iter().map(|p| [16.0 * p[0], 16.0 * p[1]].map(|x| x as usize)).collect();
        squares.sort_unstable();
        squares.dedup();
        assert_eq!(squares.len(), 256, "seed 5");
        let random = points(Design::Random, 5, 256, 1);
        let mut slices: Vec<usize> = random.iter().map(|point| (256.0 * point[0]) as usize).collect();
        slices.sort_unstable();
        slices.dedup();
        assert!(slices.len() < 220, "random points fill slices, too: the test has lost its point");
    }

    #[test]
    fn sobols_integral_of_a_smooth_function_is_ten_times_better_than_a_random_one() {
        // The integral of Π (1 + (x - 1/2)) over the cube is 1.
        let error = |design: Design, seed: u64| {
            let all = points(design, seed, 4096, 4);
            let value = |point: &Vec<f64>| point.iter().map(|x| 0.5 + x).product::<f64>();
            all.iter().map(value).sum::<f64>() / 4096.0 - 1.0
        };
        let deviation = |design| ((0..10).map(|seed| error(design, seed).powi(2)).sum::<f64>() / 10.0).sqrt();
        let (random, sobol, lhs) = (deviation(Design::Random), deviation(Design::Sobol), deviation(Design::Lhs));
        println!("seeds 0 to 9: random {random:.2e}, sobol {sobol:.2e}, lhs {lhs:.2e}");
        assert!(sobol < 0.1 * random, "seeds 0 to 9: {sobol} {random}");
        assert!(lhs < 0.5 * random, "seeds 0 to 9: {lhs} {random}");
    }

    #[test]
    fn a_latin_hypercube_has_one_member_in_each_slice() {
        for members in [1, 2, 3, 5, 17, 64, 100, 1000] {
            let all = points(Design::Lhs, 3, members, 3);
            for coordinate in 0..3 {
                let mut slices: Vec<u64> =
                    all.iter().map(|point| (members as f64 * point[coordinate]) as u64).collect();
                slices.sort_unstable();
                assert!(slices.into_iter().eq(0..members), "seed 3: {members} members, coordinate {coordinate}");
            }
        }
    }

    #[test]
    fn every_permutation_of_a_few_is_equally_probable() {
        let (count, seeds) = (4, 24_000_u64);
        let mut seen = std::collections::BTreeMap::new();
        for seed in 0..seeds {
            let order: Vec<u64> = (0..count).map(|rank| permuted(rank, count, seed, 0, 0)).collect();
            *seen.entry(order).or_insert(0_u32) += 1;
        }
        assert_eq!(seen.len(), 24, "{seen:?}");
        let chi2: f64 = seen.values().map(|own| (f64::from(*own) - 1000.0).powi(2) / 1000.0).sum();
        // The 99.9 % quantile of chi-square with 23 degrees of freedom is 49.7.
        assert!(chi2 < 49.7, "seeds 0 to {seeds}: chi2 {chi2}, {seen:?}");
    }

    #[test]
    fn seed_cell_and_place_change_a_design() {
        let base = DrawAddress { seed: 1, members: 10, member: 3, place: 0, coordinate: 0 };
        for design in [Design::Random, Design::Sobol, Design::Lhs] {
            let u = design.uniform(&base);
            for other in [
                DrawAddress { seed: 2, ..base },
                DrawAddress { seed: 1 << 40, ..base },
                DrawAddress { member: 13, ..base },
                DrawAddress { member: 4, ..base },
                DrawAddress { place: 1, coordinate: 1, ..base },
            ] {
                assert_ne!(design.uniform(&other), u, "{design:?} {other:?}");
            }
        }
    }
}
