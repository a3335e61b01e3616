//! The law of a member: `b(k)`, and `φ(k) = k² - b(k)/k` of the position equation; the waves of a surface energy γ and
//! of a mobility M that depend on the direction. Twin of the beginning of `shaders/forces.wgsl`.
//!
//! Only [`forces`](super::forces), the position equation and [`observe`](super::observe) ask for its values. Waves are
//! powers of the unit tangent, without angles.

use super::Parameters;
use crate::{
    crystal::{MOST_WAVES, WAVE},
    flow::{DIFFUSIVITY_WAVES, ENERGY_UNIT, ENERGY_WAVES, MAX_DEGREE},
    forcing::{CONSERVED, DRIVE, FEEDBACK},
    number::{Number, Real},
};

/// Properties of a law that decide which instructions are run: members side by side have them in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Kind {
    /// Degree of `b(k)`.
    pub degree: usize,
    /// m of the waves of γ, 0 for none.
    pub energy: [u8; MOST_WAVES],
    /// m of the waves of M, 0 for none.
    pub diffusivity: [u8; MOST_WAVES],
    /// Whether a driving force acts.
    pub driven: bool,
    /// What is kept: 1 the area, 2 the length, 3 both, 0 nothing.
    pub conserved: u8,
}

impl Kind {
    /// Returns whether γ or M depend on the direction.
    #[inline(always)]
    pub fn is_crystal(&self) -> bool {
        self.energy[0] != 0 || self.is_diffusive()
    }

    /// Returns whether M does.
    #[inline(always)]
    pub fn is_diffusive(&self) -> bool {
        self.diffusivity[0] != 0
    }
}

impl<T: Real> Parameters<T> {
    /// Returns the kind of the law, on which the [branches](super::Branches) of a member depend.
    pub fn kind_of_law(&self) -> Kind {
        let zero = T::of(0.0);
        let modes = |place: usize| std::array::from_fn(|wave| self.law[place + wave * WAVE].to_f64() as u8);
        let degree = self.law[..MAX_DEGREE].iter().rposition(|c| *c != zero).map_or(0, |j| j + 1);
        let conserved = self.law[CONSERVED].to_f64() as u8;
        Kind {
            // A multiplier is a coefficient of k.
            degree: if conserved == 0 { degree } else { degree.max(1) },
            energy: modes(ENERGY_WAVES),
            diffusivity: modes(DIFFUSIVITY_WAVES),
            driven: self.law[DRIVE] != zero || self.law[FEEDBACK] != zero,
            conserved,
        }
    }
}

impl<N: Number> Parameters<N> {
    /// Returns the law, which is of this kind.
    #[inline(always)]
    pub fn law(&self, kind: Kind) -> Law<N> {
        let mut coefficients = [N::of(0.0); MAX_DEGREE];
        coefficients.copy_from_slice(&self.law[..MAX_DEGREE]);
        let (energy, diffusivity) = (self.waves(ENERGY_WAVES), self.waves(DIFFUSIVITY_WAVES));
        Law { coefficients, energy, diffusivity, unit: self.law[ENERGY_UNIT], kind }
    }

    /// The waves from this place on: the factors of the real and of the imaginary part of the power.
    #[inline(always)]
    fn waves(&self, place: usize) -> [[N; 2]; MOST_WAVES] {
        let mut waves = [[N::of(0.0); 2]; MOST_WAVES];
        for (i, wave) in waves.iter_mut().enumerate() {
            let at = place + i * WAVE;
            *wave = [self.law[at + 1], self.law[at + 2]];
        }
        waves
    }
}

/// `b(k) = c₁k + c₂k² + …`, up to its degree, and the waves of γ and M.
#[derive(Clone, Copy, Debug, Default)]
pub struct Law<N> {
    coefficients: [N; MAX_DEGREE],
    energy: [[N; 2]; MOST_WAVES],
    diffusivity: [[N; 2]; MOST_WAVES],
    /// Factor of `∮γ ds` in the energy that is reported.
    pub(super) unit: N,
    pub(super) kind: Kind,
}

/// What γ and M are on a segment, in the direction of its unit tangent, less 1; and the powers that they come from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Directed<N> {
    /// γ + γ″ - 1.
    pub stiffness: N,
    /// M - 1.
    pub diffusivity: N,
    energy_powers: [[N; 2]; MOST_WAVES],
    diffusivity_powers: [[N; 2]; MOST_WAVES],
}

impl<N: Number> Law<N> {
    /// `b(k)` by Horner's rule.
    #[inline(always)]
    pub fn b(&self, k: N) -> N {
        self.b_over_k(k) * k
    }

    /// `φ(k) = k² - b(k)/k`, without division.
    #[inline(always)]
    pub fn phi(&self, k: N) -> N {
        k * k - self.b_over_k(k)
    }

    /// Adds a multiplier to c₁.
    #[inline(always)]
    pub fn tighten(&mut self, by: N) {
        self.coefficients[0] += by;
    }

    #[inline(always)]
    fn b_over_k(&self, k: N) -> N {
        let mut sum = N::of(0.0);
        for c in self.coefficients[..self.kind.degree].iter().rev() {
            sum = sum * k + *c;
        }
        sum
    }

    /// γ + γ″ and M, less 1, in the direction of a unit tangent.
    #[inline(always)]
    pub fn directed(&self, tangent: [N; 2]) -> Directed<N> {
        let mut all = Directed::default();
        for i in 0..MOST_WAVES {
            let mode = self.kind.energy[i];
            if mode != 0 {
                let z = power(tangent, mode);
                all.energy_powers[i] = z;
                all.stiffness += stiffening::<N>(mode) * part(self.energy[i], z);
            }
            let mode = self.kind.diffusivity[i];
            if mode != 0 {
                let z = power(tangent, mode);
                all.diffusivity_powers[i] = z;
                all.diffusivity += part(self.diffusivity[i], z);
            }
        }
        all
    }

    /// The same at the node between two segments: `[γ + γ″, M]` in the direction that halves the angle between their
    /// tangents.
    ///
    /// The mean of the powers on both sides has that direction, and the length cos(mθ/2). With Δ between them, 1 + Δ²/8
    /// makes up for it, but for (mθ)⁴/400.
    #[inline(always)]
    pub fn between(&self, before: &Directed<N>, after: &Directed<N>) -> [N; 2] {
        let one = N::of(1.0);
        let (mut stiffness, mut diffusivity) = (one, one);
        for i in 0..MOST_WAVES {
            let mode = self.kind.energy[i];
            if mode != 0 {
                let z = halfway(before.energy_powers[i], after.energy_powers[i]);
                stiffness += stiffening::<N>(mode) * part(self.energy[i], z);
            }
            if self.kind.diffusivity[i] != 0 {
                let z = halfway(before.diffusivity_powers[i], after.diffusivity_powers[i]);
                diffusivity += part(self.diffusivity[i], z);
            }
        }
        [stiffness, diffusivity]
    }

    /// `[γ, γ′, γ + γ″]` in the direction of a unit tangent.
    #[inline(always)]
    pub fn tension(&self, tangent: [N; 2]) -> [N; 3] {
        let (one, zero) = (N::of(1.0), N::of(0.0));
        let mut all = [one, zero, one];
        for i in 0..MOST_WAVES {
            let mode = self.kind.energy[i];
            if mode != 0 {
                let ([a, b], [x, y]) = (self.energy[i], power(tangent, mode));
                let wave = part([a, b], [x, y]);
                all[0] += wave;
                all[1] += N::of(f64::from(mode)) * (b * x - a * y);
                all[2] += stiffening::<N>(mode) * wave;
            }
        }
        all
    }
}

/// `1 - m²`, the factor of a wave in γ + γ″.
#[inline(always)]
fn stiffening<N: Number>(mode: u8) -> N {
    let mode = f64::from(mode);
    N::of(1.0 - mode * mode)
}

/// `a Re z + b Im z`.
#[inline(always)]
fn part<N: Number>([a, b]: [N; 2], [x, y]: [N; 2]) -> N {
    a * x + b * y
}

/// `z^m` of a complex number, m ≥ 1, by squaring.
#[inline(always)]
fn power<N: Number>([x, y]: [N; 2], mode: u8) -> [N; 2] {
    let (mut re, mut im) = (x, y);
    let mut bit = mode.ilog2();
    while bit > 0 {
        bit -= 1;
        let both = re * im;
        (re, im) = ((re - im) * (re + im), both + both);
        if mode >> bit & 1 != 0 {
            (re, im) = (re * x - im * y, re * y + im * x);
        }
    }
    [re, im]
}

/// The unit number halfway between two, along the circle.
#[inline(always)]
fn halfway<N: Number>([ax, ay]: [N; 2], [bx, by]: [N; 2]) -> [N; 2] {
    let (dx, dy) = (bx - ax, by - ay);
    let share = N::of(0.5) + N::of(0.0625) * (dx * dx + dy * dy);
    [share * (ax + bx), share * (ay + by)]
}
