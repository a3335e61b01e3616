//! A sequence of random numbers.

use curvelax::random::Stream;

pub struct Random {
    stream: Stream,
    next: u32,
}

impl Random {
    pub fn new(seed: u64) -> Random {
        Random { stream: Stream::new(seed, 0, 0), next: 0 }
    }

    /// Uniform between 0 and 1.
    pub fn real(&mut self) -> f64 {
        self.next += 1;
        self.stream.uniforms(self.next)[0]
    }

    /// An integer below `limit`.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.real() * limit as f64) as usize
    }
}
