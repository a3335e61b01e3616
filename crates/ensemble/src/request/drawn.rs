//! A value of the spec in which numbers may be distributions: `ellipse:uniform(1.2..3),1`.
//!
//! Such a value is a *template*: text with distributions in it. A number for each gives text without any, which is read
//! as ever, so that shapes and flows know nothing of distributions. Numbers print to read back exactly.

use std::{fmt, str::FromStr, sync::Arc};

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::Value;

use super::choices::{number, read};

use curvelax_base::{
    error::echo,
    random::{Design, Distribution, DrawAddress},
    text::rounded,
};
use curvelax_curve::Shape;
use curvelax_flow::{
    crystal::{Diffusivity, Energy},
    flow::Flow,
    forcing::Drive,
};

/// What may be drawn.
pub trait Drawable: Clone + PartialEq + fmt::Display + Serialize + FromStr<Err: fmt::Display> {
    /// What a value in a file is.
    const EXPECTED: &'static str = "a string";

    /// Reads a value without distributions.
    ///
    /// # Errors
    /// A message.
    fn read(text: &str) -> Result<Self, String> {
        text.parse().map_err(|error: Self::Err| error.to_string())
    }

    /// The value that a number is, if it is one.
    fn of_number(_: f64) -> Option<Self> {
        None
    }

    /// Whether `text` is a value that is no number, of those that may be one.
    fn is_text(_: &str) -> bool {
        false
    }

    /// Whether parentheses in `text` are those of distributions.
    fn has_distributions(text: &str) -> bool {
        text.contains('(')
    }
}

impl Drawable for f64 {
    const EXPECTED: &'static str = "a number, or a distribution in quotes such as \"uniform(0.01..0.1)\"";

    fn read(text: &str) -> Result<f64, String> {
        text.trim().parse().map_err(|_| "not a number".into())
    }

    fn of_number(number: f64) -> Option<f64> {
        Some(number)
    }
}

impl Drawable for Flow {}

impl Drawable for Shape {
    /// Names of files have parentheses of their own.
    fn has_distributions(text: &str) -> bool {
        text.contains('(') && !text.starts_with("file:")
    }
}

impl Drawable for Drive {
    const EXPECTED: &'static str = "a number, or text such as \"feedback:1,3.14\" or \"uniform(0.1..1)\"";

    fn of_number(number: f64) -> Option<Drive> {
        number.is_finite().then_some(Drive::Constant(number))
    }

    fn is_text(text: &str) -> bool {
        text.trim().parse::<f64>().is_err()
    }
}

impl Drawable for Energy {
    const EXPECTED: &'static str = "1, or text such as \"cos:4,0.03\"";

    fn of_number(number: f64) -> Option<Energy> {
        (number == 1.0).then(Energy::default)
    }
}

impl Drawable for Diffusivity {
    const EXPECTED: &'static str = "1, or text such as \"cos:4,0.5\"";

    fn of_number(number: f64) -> Option<Diffusivity> {
        (number == 1.0).then(Diffusivity::default)
    }
}

/// A value that is the same for all members, or drawn for each.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn<T> {
    typical: T,
    template: Option<Arc<DrawnText>>,
}

/// Text with distributions in it.
#[derive(Debug, PartialEq)]
struct DrawnText {
    /// The text before each distribution.
    before: Vec<String>,
    distributions: Vec<Distribution>,
    /// The text after the last.
    after: String,
}

impl<T> Drawn<T> {
    /// The value of all members; if each has its own, the one at the medians of the distributions.
    pub fn typical(&self) -> &T {
        &self.typical
    }

    /// Whether each member has its own value.
    pub fn is_drawn(&self) -> bool {
        self.template.is_some()
    }
}

impl<T: Drawable> Drawn<T> {
    /// The value with these numbers in the place of its distributions.
    ///
    /// # Errors
    /// A message if there is no such value.
    pub fn at(&self, numbers: &[f64]) -> Result<T, String> {
        self.template.as_ref().map_or_else(|| Ok(self.typical.clone()), |template| T::read(&template.at(numbers)))
    }
}

/// A [`Drawn`] value of any type.
pub(crate) trait AnyDrawn: fmt::Display {
    /// The distributions in it, from left to right.
    fn distributions(&self) -> &[Distribution];

    /// Why a member could be refused for its value.
    fn refusal(&self) -> Option<String>;
}

impl<T: Drawable> AnyDrawn for Drawn<T> {
    fn distributions(&self) -> &[Distribution] {
        self.template.as_ref().map_or(&[], |template| &template.distributions)
    }

    fn refusal(&self) -> Option<String> {
        refusal(&self.distributions().iter().collect::<Vec<_>>(), |numbers| self.at(numbers).err())
    }
}

impl<T> From<T> for Drawn<T> {
    fn from(value: T) -> Drawn<T> {
        Drawn { typical: value, template: None }
    }
}

/// Where the parenthesis before `text` closes.
fn matching(text: &str) -> Option<usize> {
    let mut open = 1;
    text.char_indices().find_map(|(place, c)| {
        match c {
            '(' => open += 1,
            ')' => open -= 1,
            _ => {}
        }
        (open == 0).then_some(place)
    })
}

/// What follows the word `in` at the beginning of `text`, if that is its first word.
fn range_of_cut(text: &str) -> Option<&str> {
    let text = text.trim_start();
    let (word, range) = text.split_at_checked(2)?;
    (word.eq_ignore_ascii_case("in") && !range.starts_with(|c: char| c.is_alphabetic())).then(|| range.trim_start())
}

impl DrawnText {
    fn read(text: &str) -> Result<DrawnText, String> {
        let (mut before, mut distributions, mut rest) = (Vec::new(), Vec::new(), text);
        while let Some((head, tail)) = rest.split_once('(') {
            let head = head.trim_end();
            let name = head.rsplit(|c: char| !c.is_alphanumeric() && c != '-' && c != '_').next().unwrap_or_default();
            let open = || format!("`{}` has no closing parenthesis", echo(format_args!("{name}({tail}")));
            // All of a distribution that is wrongly inside another, for the message.
            let close = matching(tail).or_else(|| tail.find(')')).ok_or_else(open)?;
            let (arguments, after) = (&tail[..close], &tail[close + 1..]);
            let law = Distribution::of(name, arguments)?;
            before.push(head[..head.len() - name.len()].to_owned());
            // A range has neither commas nor colons, which separate the numbers of a shape.
            let (law, after) = match range_of_cut(after) {
                Some(range) => {
                    let (range, after) = range.split_at(range.find([',', ':', ';']).unwrap_or(range.len()));
                    (law.within(range)?, after)
                }
                None => (law, after),
            };
            distributions.push(law);
            rest = after;
        }
        Ok(DrawnText { before, distributions, after: rest.to_owned() })
    }

    fn filled<I: fmt::Display>(&self, with: impl IntoIterator<Item = I>) -> String {
        let parts = self.before.iter().zip(with).map(|(before, item)| format!("{before}{item}"));
        parts.collect::<String>() + &self.after
    }

    fn at(&self, numbers: &[f64]) -> String {
        self.filled(numbers)
    }
}

impl<T: Drawable> FromStr for Drawn<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Drawn<T>, String> {
        if !T::has_distributions(text) {
            return T::read(text).map(Drawn::from);
        }
        let template = DrawnText::read(text)?;
        let medians: Vec<f64> = template.distributions.iter().map(|of| of.quantile(0.5)).collect();
        let read = |numbers: &[f64]| T::read(&template.at(numbers));
        let typical = read(&medians).map_err(|error| {
            let error = read(&medians.iter().copied().map(short).collect::<Vec<_>>()).err().unwrap_or(error);
            format!("{error}, at the medians of its distributions")
        })?;
        Ok(Drawn { typical, template: Some(Arc::new(template)) })
    }
}

impl<T: fmt::Display> fmt::Display for Drawn<T> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.template {
            None => self.typical.fmt(f),
            Some(template) => f.write_str(&template.filled(&template.distributions)),
        }
    }
}

impl<T: Drawable> Serialize for Drawn<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.is_drawn() { serializer.collect_str(self) } else { self.typical.serialize(serializer) }
    }
}

impl<'de, T: Drawable> Deserialize<'de> for Drawn<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Drawn<T>, D::Error> {
        read(deserializer, T::EXPECTED, |value| match value {
            // A number in quotes is a mistake, as for all other keys.
            Value::String(text) if T::of_number(0.0).is_some() && !T::has_distributions(text) && !T::is_text(text) => {
                None
            }
            Value::String(text) => Some(text.parse()),
            value => Some(Ok(T::of_number(number(value)?)?.into())),
        })
    }
}

/// Points at which a value is tried, besides the corners of the support.
const TRIED: u64 = 256;
/// Corners of the support that are tried.
const MAX_CORNERS: usize = 4096;

/// Why a member could be refused, if the distributions can give numbers that are `refused`: inside their support, or at
/// its corners.
pub(crate) fn refusal(of: &[&Distribution], refused: impl Fn(&[f64]) -> Option<String>) -> Option<String> {
    if of.is_empty() {
        return None;
    }
    let inside = (0..TRIED).map(|point| numbers(of, point));
    inside.chain(corners(of)).find_map(|numbers| {
        let reason = refused(&numbers)?;
        Some(refused(&numbers.into_iter().map(short).collect::<Vec<_>>()).unwrap_or(reason))
    })
}

/// A number of few digits, for a message.
fn short(number: f64) -> f64 {
    rounded(number, 3).parse().unwrap_or(number)
}

/// Random point number `point` in the support.
fn numbers(distributions: &[&Distribution], point: u64) -> Vec<f64> {
    let at = |place: u32| DrawAddress { seed: 0, members: TRIED, member: point, place, coordinate: place };
    (0..).zip(distributions).map(|(place, of)| of.quantile(Design::Random.uniform(&at(place)))).collect()
}

/// All corners of the support, if they are not too many.
pub(crate) fn corners(distributions: &[&Distribution]) -> impl Iterator<Item = Vec<f64>> + use<> {
    let extremes: Vec<Vec<f64>> = distributions.iter().map(|of| of.extremes()).collect();
    let all = extremes.iter().map(Vec::len).fold(1_usize, usize::saturating_mul);
    let step = all.div_ceil(MAX_CORNERS).max(1);
    (0..all.min(MAX_CORNERS)).map(move |corner| {
        let mut rest = corner * step;
        let number = |values: &Vec<f64>| {
            let value = values[rest % values.len()];
            rest /= values.len();
            value
        };
        extremes.iter().map(number).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(text: &str) -> Drawn<Shape> {
        text.parse().unwrap()
    }

    #[test]
    fn a_value_without_distributions_is_what_it_was() {
        let plain = shape("ellipse:2,1");
        assert!(!plain.is_drawn() && plain.distributions().is_empty());
        assert_eq!(plain, Shape::Ellipse { a: 2.0, b: 1.0 }.into());
        assert_eq!(plain.at(&[]).unwrap(), *plain.typical());
        assert_eq!(serde_json::to_string(&Drawn::from(0.05)).unwrap(), "0.05");
        assert_eq!(serde_json::to_string(&plain).unwrap(), "\"ellipse:2,1\"");
        // A file may have any name.
        let file = shape("file:normal(1,2).csv");
        assert!(!file.is_drawn());
        assert_eq!(file.to_string(), "file:normal(1,2).csv");
    }

    #[test]
    fn a_template_prints_as_it_is_read_and_takes_its_numbers_exactly() {
        for text in [
            "ellipse:uniform(1.2..3),1",
            "ellipse:normal(2,0.5) in 1.2..3,gamma(4,0.3) in 0.5..1.5",
            "flower:choice(2,3,5):uniform(0.1..0.2):0.5,7:0.1",
            "circle:lognormal(1,0.2)",
        ] {
            let drawn = shape(text);
            assert!(drawn.is_drawn());
            assert_eq!(drawn.to_string(), text);
            let json = serde_json::to_string(&drawn).unwrap();
            assert_eq!(serde_json::from_str::<Drawn<Shape>>(&json).unwrap(), drawn);
        }
        let flower = shape("flower:choice(2,3,5):uniform(0.1..0.3):0.5,7:0.1");
        assert_eq!(flower.typical().to_string(), "flower:3:0.2:0.5,7:0.1");
        assert_eq!(flower.at(&[5.0, 0.1 + 0.2]).unwrap().to_string(), "flower:5:0.30000000000000004:0.5,7:0.1");
        let flow: Drawn<Flow> = "poly:normal(0,1),2,uniform(-1..0)".parse().unwrap();
        assert_eq!(flow.at(&[1e-300, -0.5]).unwrap(), Flow::Polynomial(vec![1e-300, 2.0, -0.5]));
    }

    #[test]
    fn a_number_is_a_number_or_a_distribution_but_not_a_word() {
        let read = |json: &str| serde_json::from_str::<Drawn<f64>>(json);
        assert_eq!(read("1").unwrap(), 1.0.into());
        assert_eq!(*read("\"uniform(0.01..0.1)\"").unwrap().typical(), 0.055);
        assert!(read("\"0.05\"").unwrap_err().to_string().contains("a number, or a distribution in quotes"));
        assert!(read("true").is_err());
        assert!(serde_json::from_str::<Drawn<Flow>>("1").unwrap_err().to_string().contains("expected a string"));
        assert!("uniform(1..2)x".parse::<Drawn<f64>>().is_err() && "(1)".parse::<Drawn<f64>>().is_err());
        assert!("uniform(1..2".parse::<Drawn<f64>>().unwrap_err().contains("no closing parenthesis"));
    }

    #[test]
    fn what_a_distribution_could_give_is_known_and_what_its_median_cannot_be_is_refused() {
        let refusal = |text: &str| text.parse::<Drawn<Shape>>().unwrap_err();
        for (text, part) in [
            ("flower:uniform(2..5):0.1", "is not MODE"),
            ("circle:uniform(-3..1)", "the radius -1 is out of range"),
            ("flower:2:uniform(0..0.9),3:uniform(0.7..0.9)", "add up to"),
        ] {
            let message = refusal(text);
            assert!(message.contains(part) && message.ends_with(", at the medians of its distributions"), "{message}");
        }
        for (text, part) in [
            ("ellipse:normal(1,0.5),1", "the half-axis -"),
            ("circle:choice(1,2,4,-1)", "the radius -1 is out of range"),
            // Six deviations: too rare to be seen, but not impossible.
            ("circle:normal(3,0.5)", "the radius -"),
            ("flower:2:uniform(0..0.7),3:uniform(0..0.7)", "add up to"),
        ] {
            let possible = shape(text).refusal().expect(text);
            assert!(possible.contains(part), "{text}: {possible}");
        }
        // The smallest number that can be drawn is six deviations below the mean.
        assert_eq!(shape("circle:normal(1,0.15)").refusal(), None);
        assert!(shape("circle:normal(1,0.17)").refusal().is_some());
        assert!("ellipse:normal(1,0.5) in 0.1..3,1".parse::<Drawn<Shape>>().is_ok());
        for text in ["ellipse:normal(1,0.5) in 0.1,1", "ellipse:normal(1,0.5) in 0..1..2,1"] {
            assert!(refusal(text).contains("not a range of finite numbers; write DISTRIBUTION in A..B"), "{text}");
        }
        assert!(refusal("ellipse:normal(1,0.5) in").contains("no range; write DISTRIBUTION in A..B"));
        for text in
            ["circle:normal(1,0.2)in 0.1..3", "circle:normal (1,0.2)  IN 0.1..3 ", "circle: normal(1,0.2) in 0.1..3"]
        {
            let read = text.parse::<Drawn<Shape>>().map(|shape| shape.to_string().replace(' ', ""));
            assert_eq!(read, Ok("circle:normal(1,0.2)in0.1..3".into()), "{text}");
        }
        assert!(refusal("circle:normal(1,0.2) in 0..3 in 0..2").contains("a law is cut once"));
        assert!(
            refusal("circle:normal(uniform(1..2),0.2)").contains("normal(uniform(1..2),0.2): a distribution inside")
        );
        assert!("elastic:lognormal(0.5,0.2)".parse::<Drawn<Flow>>().is_ok());
        assert!("willmore:uniform(1..2)".parse::<Drawn<Flow>>().unwrap_err().contains("takes no argument"));
    }
}
