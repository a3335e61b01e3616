//! The user's units of length and time, by name: labels only. Numbers are in these units throughout.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use curvelax_base::error::echo;

/// Characters of a unit's name.
const MAX_NAME: usize = 16;

/// Names of the units of length and time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Units {
    /// Unit of length: `um`.
    pub length: String,
    /// Unit of time: `h`.
    pub time: String,
}

impl Units {
    /// The same units in signs, for people: micrometres are entered as `um`.
    pub fn shown(&self) -> Units {
        let sign = |name: &str| match name {
            "um" => "µm".to_owned(),
            "us" => "µs".to_owned(),
            name => name.to_owned(),
        };
        Units { length: sign(&self.length), time: sign(&self.time) }
    }

    /// Puts the unit of time into the words of a picture or a page, which names it by the power of a length.
    pub fn name(&self, words: &str) -> String {
        let time = self.shown().time;
        words.replace("length⁻⁴", &format!("1/{time}")).replace("length⁴", &time)
    }

    /// The attribute `units` of an array whose unit is made of `length` alone.
    pub fn attribute(&self, unit: &str) -> String {
        unit.replace("length^4", &self.time).replace("length", &self.length)
    }
}

impl fmt::Display for Units {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{},{}", self.length, self.time)
    }
}

curvelax_base::as_text!(Units);

impl FromStr for Units {
    type Err = String;

    /// Parses `LENGTH,TIME`.
    fn from_str(text: &str) -> Result<Units, String> {
        let wrong = || format!("`{}` does not name a unit of length and one of time, for example `um,h`", echo(text));
        let (length, time) = text.split_once(',').ok_or_else(wrong)?;
        let name = |word: &str| {
            let word = word.trim();
            // They go into pages and pictures.
            let fits = (1..=MAX_NAME).contains(&word.chars().count()) && word.chars().all(char::is_alphanumeric);
            fits.then(|| word.to_owned()).ok_or_else(wrong)
        };
        Ok(Units { length: name(length)?, time: name(time)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_signs() {
        let shown = |text: &str| text.parse::<Units>().unwrap().shown().to_string();
        assert_eq!([shown("um,us"), shown("nm,h"), shown("umbra,bus")], ["µm,µs", "nm,h", "umbra,bus"]);
    }

    #[test]
    fn units_stand_where_powers_of_the_length_stood() {
        let units: Units = "um,h".parse().unwrap();
        assert_eq!(units.name("t (10⁻⁶ length⁴), rate (length⁻⁴)"), "t (10⁻⁶ h), rate (1/h)");
        assert_eq!(["length", "1/length", "length^4"].map(|unit| units.attribute(unit)), ["um", "1/um", "h"]);
    }

    #[test]
    fn units_print_as_they_are_parsed_and_others_are_refused() {
        for text in ["um,h", "µm,s", "Å,year"] {
            assert_eq!(text.parse::<Units>().unwrap().to_string(), text);
        }
        assert_eq!(" um , h ".parse::<Units>().unwrap().to_string(), "um,h");
        for text in ["", "um", "um,", ",h", "um,h,s", "um,<b>", "a b,c", "abcdefghijklmnopq,h"] {
            assert!(text.parse::<Units>().is_err(), "{text}");
        }
    }
}
