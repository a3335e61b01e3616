//! The values of a member: those of the spec, with a number drawn for each distribution.
//!
//! They are a pure function of the spec and the member. The numbers of each key have draws of their own, so that the
//! flow of a member is the same whether or not its shape is drawn, too; only the coordinates of `--design sobol` are
//! counted through, in the order shape, flow, amplitude, decay, energy, diffusivity, drive, reduced area.

use std::{
    borrow::Cow,
    f64::consts::{PI, TAU},
    fmt,
    sync::{Mutex, PoisonError},
};

use crate::{
    Spec,
    request::drawn::{AnyDrawn, Drawable, Drawn, corners, refusal},
};
use curvelax_base::{
    error::{Error, Result, echo},
    random::{Design, Distribution, DrawAddress, MAX_SOBOL},
    text::number,
};
use curvelax_curve::{RadialLaw, Shape};
use curvelax_flow::{
    crystal::Crystal,
    flow::Flow,
    forcing::{Conserved, Drive, Forcing},
};

/// Maximum number of members that are shown one by one.
pub const MAX_NAMED: u64 = 20;
/// Members whose values, besides the tails of each distribution, stand for all where a bound for all is needed. They
/// are the first ones of the first cell, whichever run.
const PROBED: u64 = 32;
/// Shares of the distributions below and above which a bound looks.
const TAILS: [f64; 2] = [1e-5, 1.0 - 1e-5];
/// The keys whose values may be drawn.
const KEYS: [&str; DRAWN] = ["shape", "flow", "amplitude", "decay", "energy", "diffusivity", "drive", "reduced-area"];
/// Their number.
pub(crate) const DRAWN: usize = 8;
/// Those that are numbers, and so have one.
const NUMBERS: [&str; 3] = ["amplitude", "decay", "reduced-area"];
/// Reduced areas: a circle has 1, and thin curves have no room for nodes.
const REDUCED_AREAS: std::ops::RangeInclusive<f64> = 0.05..=1.0;
/// Bits of the places of a key.
const PLACE_BITS: u32 = 16;

/// What may differ between the members of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct MemberValues<'a> {
    /// The curve that is perturbed.
    pub shape: Cow<'a, Shape>,
    /// The law of motion.
    pub flow: Cow<'a, Flow>,
    /// What acts besides it, for unit mobility.
    pub forcing: Forcing,
    /// σ of the perturbation.
    pub amplitude: f64,
    /// p of the perturbation.
    pub decay: f64,
    /// 4πA/L² to which its curve is stretched.
    pub reduced_area: Option<f64>,
}

impl Spec {
    /// The values of all members; where each has its own, those at the medians of the distributions.
    pub fn typical(&self) -> MemberValues<'_> {
        self.values_with(&OwnNumbers(None)).expect("the values at the medians have been read")
    }

    /// What acts besides the flow, with this driving force, whose time becomes that of unit mobility.
    fn forcing(&self, drive: Option<Drive>) -> Forcing {
        let drive = drive.map(|drive| drive.scaled(1.0 / self.mobility()));
        let kept = match (self.conserve, self.conserve_at.as_deref()) {
            (Some(Conserved::Area), Some([area])) => [*area, 0.0],
            (Some(Conserved::Length), Some([length])) => [0.0, *length],
            (_, Some([area, length])) => [*area, *length],
            _ => [0.0; 2],
        };
        Forcing { drive, conserved: self.conserve, kept }
    }

    /// The values that are drawn for `member`, an index over all cells; with common random numbers, over one.
    ///
    /// # Errors
    /// [`Error::Request`] for values that cannot be, which no member of a [study](crate::Study) has.
    pub fn values(&self, member: u64) -> Result<MemberValues<'_>> {
        self.values_with(&OwnNumbers(Some(self.numbers(|of, place| self.uniform(of, member, place)))))
    }

    /// Those of a member with this index in a study, in its cell.
    ///
    /// # Errors
    /// As [`Spec::values`].
    pub fn values_of(&self, member: u64, cell: u64) -> Result<MemberValues<'_>> {
        self.values(self.drawn_as(member, cell))
    }

    /// The index of the random numbers of the member with this index in a study, in its cell.
    pub(crate) fn drawn_as(&self, member: u64, cell: u64) -> u64 {
        if self.common_random_numbers { member - cell * self.members_per_cell() } else { member }
    }

    /// The numbers that are drawn for `member`, as for [`Spec::values`], each with its name: that of its key, and its
    /// rank from 1 where the key is text.
    pub fn drawn_numbers(&self, member: u64) -> Vec<(String, f64)> {
        let numbers = self.numbers(|of, place| self.uniform(of, member, place));
        drawn_names(self.drawn_counts()).into_iter().zip(numbers.into_iter().flatten()).collect()
    }

    /// How many numbers are drawn for each key.
    pub(crate) fn drawn_counts(&self) -> [usize; DRAWN] {
        self.distributions().map(<[Distribution]>::len)
    }

    /// Whether curves are perturbed, at least those of some members.
    pub fn is_perturbed(&self) -> bool {
        self.amplitude.is_drawn() || *self.amplitude.typical() != 0.0
    }

    /// Whether members have values of their own.
    pub fn has_drawn_values(&self) -> bool {
        self.distributions().iter().any(|of_key| !of_key.is_empty())
    }

    /// Whether each member has a law of motion of its own.
    pub fn has_drawn_flow(&self) -> bool {
        let [_, flow, _, _, energy, diffusivity, drive, _] = self.distributions();
        [flow, energy, diffusivity, drive].into_iter().any(|of_key| !of_key.is_empty())
    }

    /// Whether several members are made of one of many outlines.
    pub fn has_copies_of_outlines(&self) -> bool {
        self.outlines.is_some() && self.curves > 1
    }

    /// Whether its members are shown one by one: there are few, and each is an outline or a cell of its own. They are
    /// then no sample of anything, and have no statistics.
    pub fn names_members(&self) -> bool {
        let is_one_each = self.members_per_cell() == 1 || self.outlines.is_some() && self.curves == 1;
        is_one_each && (1..=MAX_NAMED).contains(&self.member_count())
    }

    /// Whether its members differ at all, without a sweep.
    pub fn has_different_members(&self) -> bool {
        self.has_drawn_values() || *self.amplitude.typical() != 0.0 || self.outlines.is_some_and(|count| count > 1)
    }

    /// Values in the midst and in the tails of what is drawn, for bounds; the first are the [typical](Spec::typical)
    /// ones. They depend neither on the cell nor on the members that run.
    pub(crate) fn probes(&self) -> Vec<MemberValues<'_>> {
        if !self.has_drawn_values() {
            return vec![self.typical()];
        }
        let places: u32 = self.distributions().iter().map(|of_key| of_key.len() as u32).sum();
        let tail = |place: u32, u: f64| self.numbers(|_, at| if at.coordinate == place { u } else { 0.5 });
        let tails = (0..places).flat_map(|place| TAILS.map(|u| self.values_with(&OwnNumbers(Some(tail(place, u))))));
        let members = (0..PROBED.min(self.members_per_cell())).map(|member| self.values(member));
        let probe = |values: Result<_>| values.unwrap_or_else(|_| self.typical());
        [self.typical()].into_iter().chain(tails.chain(members).map(probe)).collect()
    }

    /// Checks what the values of each key cannot say alone: the number of coordinates, and that of listed values.
    ///
    /// # Errors
    /// [`Error::Request`] with the numbers.
    pub(crate) fn check_drawn(&self) -> Result<()> {
        let places: usize = self.distributions().iter().map(|of_key| of_key.len()).sum();
        if self.design == Design::Sobol && places > MAX_SOBOL {
            let problem = format!("{places} distributions; the sequence has {MAX_SOBOL} coordinates");
            return Err(Error::value("design", "sobol", &problem, "use random or lhs, or fewer distributions"));
        }
        let keys = KEYS.into_iter().zip(self.distributions());
        for (key, listed) in
            keys.flat_map(|(key, of_key)| of_key.iter().filter_map(move |of| Some((key, of.listed()?))))
        {
            let (count, members) = (listed.len() as u64, self.members_per_cell());
            if count != members {
                let problem = format!("{count} values for {members} members");
                let remedy = format!("each member has one: use --curves {count}, or as many values");
                return Err(Error::value(key, "each(...)", &problem, &remedy));
            }
        }
        Ok(())
    }

    /// Why the values of a member could be refused, if its distributions can give such values: with the flag.
    pub(crate) fn refusal(&self) -> Option<String> {
        let told = |key: &str, drawn: &dyn fmt::Display, reason| format!("--{key} {}: {reason}", echo(drawn));
        let all = || KEYS.into_iter().zip(self.drawn()).filter_map(|(key, drawn)| Some((key, drawn?)));
        let of_key = all().find_map(|(key, drawn)| Some(told(key, drawn, drawn.refusal()?)));
        // What the values of two keys say together, or their checks.
        let of_law = || {
            let [_, _, amplitude, decay, ..] = self.distributions();
            let of: Vec<&Distribution> = amplitude.iter().chain(decay).collect();
            let reason = refusal(&of, |numbers| {
                let (first, second) = numbers.split_at(amplitude.len());
                let (amplitude, decay) = (self.amplitude.at(first).ok()?, self.decay.at(second).ok()?);
                RadialLaw::new(amplitude, self.modes, decay).err().map(|error| error.to_string())
            });
            let drawn: (&str, &dyn fmt::Display) =
                if amplitude.is_empty() { ("decay", &self.decay) } else { ("amplitude", &self.amplitude) };
            Some(told(drawn.0, drawn.1, reason?))
        };
        let of_reduced_area = || {
            let drawn = self.reduced_area.as_ref()?;
            let reason = refusal(&drawn.distributions().iter().collect::<Vec<_>>(), |numbers| {
                check_reduced_area(drawn.at(numbers).ok()?).err().map(|error| error.to_string())
            });
            Some(told("reduced-area", drawn, reason?))
        };
        of_key.or_else(of_law).or_else(of_reduced_area)
    }

    /// Checks the values of `member`, as for [`Spec::values`].
    ///
    /// # Errors
    /// [`Error::Request`] for values that cannot be.
    pub(crate) fn check_values(&self, member: u64) -> Result<()> {
        let values = self.values(member)?;
        values.reduced_area.map_or(Ok(()), check_reduced_area)?;
        RadialLaw::new(values.amplitude, self.modes, values.decay).map(drop)
    }

    /// The highest mode of a shape made of modes, whichever member's.
    pub(crate) fn highest_mode(&self) -> Option<u32> {
        // Modes are whole numbers, so only a choice can give them.
        let corners = corners(&self.shape.distributions().iter().collect::<Vec<_>>());
        let shapes = corners.filter_map(|numbers| self.shape.at(&numbers).ok());
        shapes.filter_map(|shape| shape.highest_mode()).max()
    }

    /// The keys whose values may be drawn, in the order of [`KEYS`]: those that have a value.
    fn drawn(&self) -> [Option<&dyn AnyDrawn>; DRAWN] {
        fn any<T: Drawable>(key: &Option<Drawn<T>>) -> Option<&dyn AnyDrawn> {
            key.as_ref().map(|drawn| drawn as _)
        }
        let Spec { shape, flow, amplitude, decay, energy, diffusivity, drive, reduced_area, .. } = self;
        let always: [&dyn AnyDrawn; 4] = [shape, flow, amplitude, decay];
        let [shape, flow, amplitude, decay] = always.map(Some);
        [shape, flow, amplitude, decay, any(energy), any(diffusivity), any(drive), any(reduced_area)]
    }

    /// The distributions of each key.
    pub(crate) fn distributions(&self) -> [&[Distribution]; DRAWN] {
        self.drawn().map(|drawn| drawn.map_or(&[][..], AnyDrawn::distributions))
    }

    /// The uniform number of `member` at a place: drawn, or the one that gives it its own of listed values.
    fn uniform(&self, of: &Distribution, member: u64, place: DrawAddress) -> f64 {
        match of.listed() {
            Some(_) => ((member % place.members) as f64 + 0.5) / place.members as f64,
            None => self.design.uniform(&DrawAddress { member, ..place }),
        }
    }

    fn values_with(&self, numbers: &OwnNumbers) -> Result<MemberValues<'_>> {
        let energy = numbers.own_of("energy", &self.energy)?;
        let diffusivity = numbers.own_of("diffusivity", &self.diffusivity)?;
        let drive = numbers.own_of("drive", &self.drive)?;
        let reduced_area = numbers.own_of("reduced-area", &self.reduced_area)?;
        let flow = match (energy, diffusivity) {
            (None, None) => numbers.own("flow", &self.flow)?,
            (energy, diffusivity) => {
                let (energy, diffusivity) = (energy.unwrap_or_default(), diffusivity.unwrap_or_default());
                Cow::Owned(Flow::Crystal(Crystal { energy, diffusivity }))
            }
        };
        Ok(MemberValues {
            shape: numbers.own("shape", &self.shape)?,
            flow,
            forcing: self.forcing(drive),
            amplitude: *numbers.own("amplitude", &self.amplitude)?,
            decay: *numbers.own("decay", &self.decay)?,
            reduced_area,
        })
    }

    /// The numbers of each key, from the uniform ones of their places.
    fn numbers(&self, uniform: impl Fn(&Distribution, DrawAddress) -> f64) -> [Vec<f64>; DRAWN] {
        let (seed, members) = (self.seed, self.members_per_cell());
        let (mut key, mut coordinate) = (0, 0);
        self.distributions().map(|of_key: &[Distribution]| {
            let number = |(rank, of): (u32, &Distribution)| {
                let place = key << PLACE_BITS | rank;
                let u = uniform(of, DrawAddress { seed, members, member: 0, place, coordinate: coordinate + rank });
                of.quantile(u)
            };
            let numbers: Vec<f64> = (0..).zip(of_key).map(number).collect();
            (key, coordinate) = (key + 1, coordinate + of_key.len() as u32);
            numbers
        })
    }
}

/// Checks a reduced area.
///
/// # Errors
/// [`Error::Request`] if no curve to stretch has it.
pub(crate) fn check_reduced_area(reduced: f64) -> Result<()> {
    match REDUCED_AREAS.contains(&reduced) {
        true => Ok(()),
        false => {
            let (low, high) = (number(*REDUCED_AREAS.start()), number(*REDUCED_AREAS.end()));
            let allowed = format!("use a number from {low} to {high}");
            Err(Error::value("reduced-area", number(reduced), "not 4 pi A/L^2 of a curve that nodes resolve", &allowed))
        }
    }
}

/// [`Flow::excess_rate`]. That of a crystal takes a millisecond, so the last one is kept: most members have the same.
fn excess_rate(flow: &Flow, mode: u32, area: f64) -> Option<f64> {
    static LAST: Mutex<Option<(Crystal, u32, Option<f64>)>> = Mutex::new(None);
    let Flow::Crystal(crystal) = flow else { return flow.excess_rate(mode, area) };
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    let of_unit = match *last {
        Some((of, at, rate)) if of == *crystal && at == mode => rate,
        _ => flow.excess_rate(mode, PI),
    };
    *last = Some((*crystal, mode, of_unit));
    of_unit.map(|rate| rate * (PI / area).powi(2)).filter(|rate| rate.is_finite())
}

/// The names of the numbers that are drawn, so many for each key.
pub(crate) fn drawn_names(counts: [usize; DRAWN]) -> Vec<String> {
    let name = |key: usize, rank: usize| match KEYS[key] {
        key if NUMBERS.contains(&key) => key.replace('-', "_"),
        key => format!("{key}_{}", rank + 1),
    };
    counts.into_iter().enumerate().flat_map(|(key, count)| (0..count).map(move |rank| name(key, rank))).collect()
}

/// The numbers of each key; none for the medians of all.
struct OwnNumbers(Option<[Vec<f64>; DRAWN]>);

impl OwnNumbers {
    /// The value of a key with its own numbers.
    fn own<'a, T: Drawable>(&self, key: &str, drawn: &'a Drawn<T>) -> Result<Cow<'a, T>> {
        let own = self.0.iter().flat_map(|all| KEYS.iter().zip(all)).find(|(other, _)| **other == key);
        let Some((_, numbers)) = own.filter(|_| drawn.is_drawn()) else { return Ok(Cow::Borrowed(drawn.typical())) };
        let refused = |message: String| Error::Request(format!("--{key} {}: {message}", echo(drawn)));
        drawn.at(numbers).map(Cow::Owned).map_err(refused)
    }

    /// The same for a key that need not have a value.
    fn own_of<T: Drawable + Copy>(&self, key: &str, drawn: &Option<Drawn<T>>) -> Result<Option<T>> {
        drawn.as_ref().map(|drawn| self.own(key, drawn).map(|own| *own)).transpose()
    }
}

/// What linear theory says about a member of a spec.
impl Spec {
    /// Returns the time `growth` of [`Flow::growth`] for a member of area `area` under its own flow, if that is all
    /// that acts.
    pub fn growth(&self, flow: &Flow, forcing: &Forcing, area: f64) -> Option<f64> {
        flow.growth(area).filter(|_| !forcing.acts()).map(|growth| growth / self.mobility())
    }

    /// The lowest mode, 2 or more, of a member with these values: it decays last.
    pub(crate) fn slowest_mode(&self, values: &MemberValues) -> Option<u32> {
        let drawn = (values.amplitude > 0.0).then(|| self.modes.low.max(2));
        values.shape.lowest_mode().into_iter().chain(drawn).min()
    }

    /// The rate at which, by linear theory, the excess of a member of this area and length falls once only the slowest
    /// mode is left: the lowest one of the shape and the perturbation. It is in 1/time, or an exponent: see
    /// [`Flow::excess_rate`]. A driven one has none, since its radius changes; one that keeps area or length keeps the
    /// radius.
    pub fn rate_in_theory(&self, values: &MemberValues, [area, length]: [f64; 2]) -> Option<f64> {
        let (flow, forcing, mode) = (&values.flow, &values.forcing, self.slowest_mode(values)?);
        let radius = match (forcing.conserved, forcing.drive) {
            (None, None) => {
                let rate = excess_rate(flow, mode, area)?;
                return Some(if flow.growth(area).is_some() { rate } else { self.mobility() * rate });
            }
            (Some(_), None) => forcing.radius_at_rest((area.abs() / PI).sqrt(), length / TAU)?,
            _ => return None,
        };
        Some(2.0 * self.mobility() * forcing.linear_rate(flow, mode, radius)).filter(|rate| rate.is_finite())
    }

    /// The mean excess that the perturbation of a circle has in each mode from 2 on: ½ (m²-1) a_m².
    pub(crate) fn perturbed_excess(&self, values: &MemberValues) -> Vec<f64> {
        let (low, high) = (self.modes.low, if values.amplitude == 0.0 { 1 } else { self.modes.high });
        let part = |m: u32| {
            let (deviation, of) = (values.amplitude * f64::from(m).powf(-values.decay), f64::from(m));
            if m < low { 0.0 } else { 0.5 * (of * of - 1.0) * deviation * deviation }
        };
        (2..=high).map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(text: &str) -> Spec {
        Spec::from_toml(text).unwrap()
    }

    const ALL: &str = "shape = 'ellipse:uniform(1.2..3),loguniform(0.5..1)'\nflow = 'elastic:lognormal(0.5,0.2)'\n\
                       amplitude = 'uniform(0.01..0.1)'\ndecay = 'choice(1,1.5,2)'";

    #[test]
    fn without_distributions_the_values_are_those_of_the_spec_and_cost_no_copy() {
        let spec = Spec::default();
        let values = spec.values(7).unwrap();
        assert_eq!(values, spec.typical());
        assert!(matches!(values.shape, Cow::Borrowed(_)) && matches!(values.flow, Cow::Borrowed(_)));
        assert!(!spec.has_drawn_values() && spec.drawn_numbers(7).is_empty() && spec.probes().len() == 1);
    }

    #[test]
    fn the_numbers_of_a_member_have_names_and_are_in_its_values() {
        let spec = spec(ALL);
        let numbers = spec.drawn_numbers(3);
        let names: Vec<&str> = numbers.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["shape_1", "shape_2", "flow_1", "amplitude", "decay"]);
        let values = spec.values(3).unwrap();
        assert_eq!(*values.shape, Shape::Ellipse { a: numbers[0].1, b: numbers[1].1 });
        assert_eq!(*values.flow, Flow::Elastic(numbers[2].1));
        assert_eq!([values.amplitude, values.decay], [numbers[3].1, numbers[4].1]);
        assert_eq!(*spec.typical().shape, Shape::Ellipse { a: 2.1, b: 0.5_f64.sqrt() });
    }

    #[test]
    fn a_number_is_the_same_draw_whatever_else_is_drawn() {
        let (all, alone) = (spec(ALL), spec("flow = 'elastic:lognormal(0.5,0.2)'\namplitude = 'uniform(0.01..0.1)'"));
        for member in 0..9 {
            let [one, other] = [&all, &alone].map(|spec| spec.values(member).unwrap());
            assert_eq!((one.flow, one.amplitude), (other.flow, other.amplitude));
        }
        assert_ne!(all.values(0).unwrap(), all.values(1).unwrap());
        assert_ne!(all.values(0).unwrap(), Spec { seed: 2, ..all.clone() }.values(0).unwrap());
    }

    #[test]
    fn the_draws_of_values_are_not_those_of_the_perturbation() {
        use curvelax_base::random::Stream;
        let spec = spec("amplitude = 'uniform(0..0.1)'");
        let drawn: Vec<f64> = (0..50).map(|member| 10.0 * spec.values(member).unwrap().amplitude).collect();
        for attempt in 0..20 {
            for draw in 0..20 {
                let words = |member: u64| Stream::new(1, member, attempt).uniforms(draw);
                assert!((0..50).all(|member| words(member).iter().all(|u| (u - drawn[member as usize]).abs() > 1e-12)));
            }
        }
    }

    #[test]
    fn a_law_of_the_perturbation_that_some_members_could_break_is_known() {
        for (text, start) in [
            ("amplitude = 'normal(0.05,0.025)'", "--amplitude normal(0.05,0.025): --amplitude -"),
            ("amplitude = 'uniform(0..1)'", "--amplitude uniform(0..1): "),
            ("decay = 'uniform(0..40)'", "--decay uniform(0..40): --decay "),
            ("amplitude = 0.3\ndecay = 'uniform(-1..1)'", "--decay uniform(-1..1): "),
        ] {
            let possible = spec(text).validate().unwrap().refusal().expect(text);
            assert!(possible.starts_with(start), "{text}: {possible}");
        }
        assert_eq!(spec(ALL).refusal(), None);
    }

    #[test]
    fn a_sequence_has_so_many_coordinates() {
        let modes: Vec<String> = (2..=24).map(|mode| format!("{mode}:uniform(0..0.01)")).collect();
        let many = spec(&format!("design = 'sobol'\nshape = 'flower:{}'", modes.join(",")));
        assert!(many.validate().unwrap_err().to_string().starts_with("--design sobol: 23 distributions; "));
    }

    #[test]
    fn probes_reach_into_the_tails() {
        let spec = spec("shape = 'circle:lognormal(1,1)'");
        let probes = spec.probes();
        let radii = probes.iter().map(|values| match *values.shape {
            Shape::Circle { radius } => radius,
            _ => f64::NAN,
        });
        let (low, high) = radii.fold((f64::INFINITY, 0.0_f64), |(low, high), r| (low.min(r), high.max(r)));
        assert!(low < 0.05 && high > 20.0, "{low} {high}");
    }
}
