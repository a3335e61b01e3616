//! Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011), in f64 on the CPU.
//!
//! A counter-based generator has no state that changes with each draw. It is a keyed bijection of 128-bit blocks, ten
//! rounds of multiplications and swaps; the n-th draw is the image of n. A draw is thus a pure function of *where* it
//! is used: here the seed (the key), the member, the attempt and the draw within the attempt (the counter). Member j is
//! the same in any batch, shard, order, thread count or back end, and can be repeated alone.
//!
//! The uniforms have the same bits everywhere. A normal number needs one logarithm and one cosine, so two machines
//! agree on it as far as their mathematical libraries do (a few units in the last place).

mod design;
pub mod distribution;
mod normal;

use std::f64::consts::TAU;

pub use design::{Design, DrawAddress, MAX_SOBOL};
pub use distribution::Distribution;
pub use normal::normal_quantile;

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

/// Philox4x32-10: the random block of `counter` under `key`.
pub fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let ([mut c0, mut c1, mut c2, mut c3], [mut k0, mut k1]) = (counter, key);
    for _ in 0..ROUNDS {
        let (high_a, low_a) = wide_product(MULTIPLIERS[0], c0);
        let (high_b, low_b) = wide_product(MULTIPLIERS[1], c2);
        (c0, c1, c2, c3) = (high_b ^ c1 ^ k0, low_b, high_a ^ c3 ^ k1, low_a);
        (k0, k1) = (k0.wrapping_add(WEYL[0]), k1.wrapping_add(WEYL[1]));
    }
    [c0, c1, c2, c3]
}

/// High and low half of a 32 × 32 bit product.
fn wide_product(a: u32, b: u32) -> (u32, u32) {
    let product = u64::from(a) * u64::from(b);
    ((product >> 32) as u32, product as u32)
}

/// The draws of one attempt at a member.
///
/// Draws are addressed, not consumed: `normal(3)` is the same whether or not `normal(2)` was called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    key: [u32; 2],
    index: u64,
    attempt: u32,
}

impl Stream {
    /// The stream of `attempt` (from 0) at member `index` of the ensemble with `seed`.
    pub fn new(seed: u64, index: u64, attempt: u32) -> Stream {
        Stream { key: [seed as u32, (seed >> 32) as u32], index, attempt }
    }

    /// Four independent words of random bits.
    pub fn words(&self, draw: u32) -> [u32; 4] {
        philox([draw, self.attempt, self.index as u32, (self.index >> 32) as u32], self.key)
    }

    /// Two independent uniforms in the open interval (0, 1), from the words of the same draw.
    pub fn uniforms(&self, draw: u32) -> [f64; 2] {
        let [a, b, c, d] = self.words(draw);
        [open_uniform(a, b), open_uniform(c, d)]
    }

    /// A standard normal number, by the cosine form of Box and Muller.
    pub fn normal(&self, draw: u32) -> f64 {
        let [u, v] = self.uniforms(draw);
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    }
}

/// An odd multiple of 2^-53: symmetric about ½, never 0 (whose logarithm is infinite) and never 1.
fn open_uniform(low: u32, high: u32) -> f64 {
    let bits = u64::from(high) << 32 | u64::from(low);
    (bits >> 11 | 1) as f64 * (0.5 / (1_u64 << 52) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_gives_the_known_answers_of_random123() {
        let vectors = [
            ([0; 4], [0; 2], [0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd]),
            (
                [0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344],
                [0xa4093822, 0x299f31d0],
                [0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1],
            ),
        ];
        for (counter, key, answer) in vectors {
            assert_eq!(philox(counter, key), answer);
        }
    }

    #[test]
    fn uniforms_stay_inside_the_open_interval() {
        assert_eq!(open_uniform(0, 0), 2.0_f64.powi(-53));
        assert_eq!(open_uniform(u32::MAX, u32::MAX), 1.0 - 2.0_f64.powi(-53));
        assert_eq!(open_uniform(0, 1 << 31), 0.5 + 2.0_f64.powi(-53));
    }

    #[test]
    fn every_part_of_the_address_changes_the_draw() {
        let big = 1_u64 << 32;
        let draws = [
            Stream::new(1, 0, 0).uniforms(0),
            Stream::new(1, 0, 0).uniforms(1),
            Stream::new(1, 0, 1).uniforms(0),
            Stream::new(1, 1, 0).uniforms(0),
            Stream::new(1, big, 0).uniforms(0),
            Stream::new(2, 0, 0).uniforms(0),
            Stream::new(1 + big, 0, 0).uniforms(0),
        ];
        for (i, a) in draws.iter().enumerate() {
            assert!(a[0] != a[1] && draws[..i].iter().all(|b| a[0] != b[0] && a[1] != b[1]), "draw {i}");
        }
    }

    #[test]
    fn normals_have_the_moments_of_the_normal_law() {
        let count = 100_000;
        let stream = Stream::new(7, 11, 0);
        let moment = |p| (0..count).map(|draw| stream.normal(draw).powi(p)).sum::<f64>() / f64::from(count);
        // Five standard errors each: var z = 1, var z² = 2, var z³ = 15, var z⁴ = 96.
        for (p, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let bound = 5.0 * (variance / f64::from(count)).sqrt();
            let found = moment(p);
            assert!((found - expected).abs() < bound, "seed 7: moment {p} is {found}, not {expected} ± {bound}");
        }
    }

    #[test]
    fn the_first_normals_of_seed_1_never_change() {
        let found: Vec<f64> = (0..2).map(|draw| Stream::new(1, 0, 0).normal(draw)).collect();
        let pinned = [-0.11368019704496914, -0.28859563518898057];
        for (f, p) in found.iter().zip(pinned) {
            assert!((f - p).abs() < 1e-14, "{found:?}");
        }
    }
}
