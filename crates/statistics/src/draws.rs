//! Random numbers for resampling, from the generator of the members.

use curvelax_base::random::Stream;

/// The attempt number in a stream's address that is reserved for resampling; members count theirs from 0.
const ATTEMPT: u32 = u32::MAX;

/// Sequential draws; a pure function of the seed and the resample.
#[derive(Clone, Debug)]
pub struct Draws {
    stream: Stream,
    next: u32,
}

impl Draws {
    /// Starts the draws of one resample.
    pub fn new(seed: u64, resample: u64) -> Draws {
        Draws { stream: Stream::new(seed, resample, ATTEMPT), next: 0 }
    }

    fn words(&mut self) -> [u32; 4] {
        self.next = self.next.wrapping_add(1);
        self.stream.words(self.next)
    }

    fn uniform(&mut self) -> f64 {
        self.next = self.next.wrapping_add(1);
        self.stream.uniforms(self.next)[0]
    }

    /// Returns the number of blocks of random numbers used.
    #[cfg(test)]
    pub fn blocks(&self) -> u32 {
        self.next
    }

    /// Throws `count` balls into equally likely boxes, and adds them to the numbers there.
    ///
    /// Boxes differ in probability by at most their number over 2³², relatively. There must be at least one.
    pub fn scatter(&mut self, count: usize, boxes: &mut [u32]) {
        let number = boxes.len() as u64;
        let mut throw = |word: u32| boxes[((u64::from(word) * number) >> 32) as usize] += 1;
        for _ in 0..count / 4 {
            self.words().into_iter().for_each(&mut throw);
        }
        self.words().into_iter().take(count % 4).for_each(throw);
    }

    /// Draws the number of successes among `count` independent draws, each with probability `share` ∈ [0, 1].
    ///
    /// By inversion from the most probable number outwards: about √`count` terms and one uniform. The relative error of
    /// its probabilities against the binomial law is within 1e-8 for counts up to a million.
    pub fn binomial(&mut self, count: usize, share: f64) -> usize {
        if count == 0 || share <= 0.0 {
            return 0;
        }
        if share >= 1.0 {
            return count;
        }
        let mode = ((count + 1) as f64 * share) as usize;
        let mode = mode.min(count);
        let odds = share / (1.0 - share);
        let start = probability(count, mode, share);
        let mut left = self.uniform() - start;
        let (mut low, mut below) = (mode, start);
        let (mut high, mut above) = (mode, start);
        while left >= 0.0 {
            if high < count {
                above *= (count - high) as f64 / (high + 1) as f64 * odds;
                high += 1;
                left -= above;
                if left < 0.0 {
                    return high;
                }
            }
            if low > 0 {
                below *= low as f64 / (count - low + 1) as f64 / odds;
                low -= 1;
                left -= below;
                if left < 0.0 {
                    return low;
                }
            }
            let over = (high == count || above < NEGLIGIBLE) && (low == 0 || below < NEGLIGIBLE);
            if over {
                // Rounding left a remainder that belongs to no number.
                return mode;
            }
        }
        mode
    }
}

const NEGLIGIBLE: f64 = 1e-30;

/// Probability of `successes` among `count`, 0 < `share` < 1.
fn probability(count: usize, successes: usize, share: f64) -> f64 {
    let ln_factorial = |n: usize| libm::lgamma(n as f64 + 1.0);
    let failures = count - successes;
    let ways = ln_factorial(count) - ln_factorial(successes) - ln_factorial(failures);
    (ways + successes as f64 * share.ln() + failures as f64 * (-share).ln_1p()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of each number in `draws` binomials, and Pearson's χ² against the law over numbers expected often.
    fn misfit(count: usize, share: f64, law: f64, draws: usize) -> (f64, usize) {
        let mut random = Draws::new(3, count as u64);
        let mut counts = vec![0.0; count + 1];
        (0..draws).for_each(|_| counts[random.binomial(count, share)] += 1.0);
        let (mut misfit, mut cells) = (0.0, 0);
        for (successes, seen) in counts.iter().enumerate() {
            let expected = draws as f64 * probability(count, successes, law);
            if expected >= 10.0 {
                misfit += (seen - expected).powi(2) / expected;
                cells += 1;
            }
        }
        (misfit, cells)
    }

    #[test]
    fn binomial_counts_follow_their_law_and_no_other() {
        for (count, share) in [(1, 0.5), (2, 0.9), (7, 0.3), (40, 0.5), (1000, 0.001), (1000, 0.7)] {
            let (found, cells) = misfit(count, share, share, 100_000);
            // Six standard deviations of χ² above its mean.
            let bound = cells as f64 + 6.0 * (2.0 * cells as f64).sqrt();
            assert!(found < bound, "seed 3: {count} {share}: {found} over {cells}");
            let (other, _) = misfit(count, share, share * 0.97, 100_000);
            assert!(other > bound, "seed 3: {count} {share}: blind, {other}");
        }
    }

    #[test]
    fn large_counts_have_the_moments_of_their_law() {
        let (count, share, draws) = (1_000_000, 0.3, 20_000);
        let mut random = Draws::new(4, 0);
        let scaled: Vec<f64> = (0..draws)
            .map(|_| (random.binomial(count, share) as f64 - 3e5) / (count as f64 * share * (1.0 - share)).sqrt())
            .collect();
        let moment = |p| scaled.iter().map(|z| z.powi(p)).sum::<f64>() / draws as f64;
        let bound = 5.0 / (draws as f64).sqrt();
        assert!(moment(1).abs() < bound && (moment(2) - 1.0).abs() < 1.5 * bound, "{} {}", moment(1), moment(2));
    }

    #[test]
    fn certain_and_impossible_draws_are_so() {
        let mut random = Draws::new(1, 0);
        for count in [0, 1, 5, 1_000_000] {
            assert_eq!((random.binomial(count, 0.0), random.binomial(count, 1.0)), (0, count));
            assert!(random.binomial(count, 1e-300) == 0 && random.binomial(count, 0.5) <= count);
        }
    }

    #[test]
    fn balls_are_thrown_into_all_boxes_alike() {
        for (boxes, balls) in [(1, 5), (3, 30_000), (1021, 500_003)] {
            let mut counts = vec![0; boxes];
            Draws::new(2, 0).scatter(balls, &mut counts);
            assert_eq!(counts.iter().sum::<u32>() as usize, balls);
            let expected = balls as f64 / boxes as f64;
            let misfit: f64 = counts.iter().map(|n| (f64::from(*n) - expected).powi(2) / expected).sum();
            let bound = boxes as f64 + 6.0 * (2.0 * boxes as f64).sqrt();
            assert!(misfit < bound, "seed 2: {boxes} boxes: {misfit}");
        }
    }

    #[test]
    fn two_resamples_and_two_seeds_draw_differently() {
        let thrown = |seed, resample| {
            let mut counts = [0; 100];
            Draws::new(seed, resample).scatter(100, &mut counts);
            counts
        };
        assert!(thrown(1, 0) == thrown(1, 0) && thrown(1, 0) != thrown(1, 1) && thrown(1, 0) != thrown(2, 0));
    }

    #[test]
    fn the_first_draws_of_seed_1_never_change() {
        let (mut random, mut boxes) = (Draws::new(1, 0), [0; 8]);
        random.scatter(20, &mut boxes);
        let counts = [random.binomial(10, 0.5), random.binomial(1000, 0.5), random.binomial(1_000_000, 0.25)];
        assert_eq!((boxes, counts), ([2, 2, 1, 3, 1, 3, 3, 5], [5, 480, 250_227]));
    }
}
