//! A part of a study that is run separately, on another machine or at another time.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use curvelax_base::error::echo;

/// The members j of a study with j mod N = I, counted through all cells of a sweep, so that slow cells are spread over
/// all shards. Written `I/N`.
///
/// ```
/// use curvelax_ensemble::Shard;
///
/// let shard: Shard = "1/3".parse()?;
/// assert_eq!((0..7).filter(|member| shard.has(*member)).collect::<Vec<_>>(), [1, 4]);
/// assert!("3/3".parse::<Shard>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Shard {
    /// Returns shard `index` of `count`.
    ///
    /// # Errors
    /// A message about the wrong number.
    pub fn new(index: u64, count: u64) -> Result<Shard, String> {
        match (index, count) {
            (_, 0) => Err(format!("shard {index}/{count}: there are no shards; use I/N with N from 1")),
            _ if index >= count => {
                Err(format!("shard {index}/{count}: shards count from 0; use I from 0 to {}", count - 1))
            }
            _ => Ok(Shard { index, count }),
        }
    }

    /// I, from 0.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// N.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Whether `member` belongs to it.
    pub fn has(&self, member: u64) -> bool {
        member % self.count == self.index
    }

    /// The same members, counted from member `first` of the study.
    pub(crate) fn from(self, first: u64) -> Shard {
        Shard { index: (self.index + self.count - first % self.count) % self.count, ..self }
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let whole = |text: &str| text.trim().parse::<u64>().ok();
        let parts = text.split_once('/').and_then(|(index, count)| Some((whole(index)?, whole(count)?)));
        let (index, count) = parts.ok_or_else(|| format!("`{}` is not a shard; write I/N, such as 0/8", echo(text)))?;
        Shard::new(index, count)
    }
}

curvelax_base::as_text!(Shard);

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_have_every_member_once_also_counted_from_elsewhere() {
        for count in [1, 3, 8, 64] {
            for first in [0, 1, 7, 100] {
                for member in 0..200 {
                    let has = |index: &u64| Shard::new(*index, count).unwrap().from(first).has(member);
                    assert_eq!((0..count).filter(has).collect::<Vec<_>>(), [(first + member) % count]);
                }
            }
        }
    }

    #[test]
    fn what_is_no_shard_is_refused_with_what_is_one() {
        for (text, told) in [
            ("3/3", "use I from 0 to 2"),
            ("0/0", "use I/N with N from 1"),
            ("3", "such as 0/8"),
            ("-1/3", "such as 0/8"),
            ("1/3/5", "such as 0/8"),
        ] {
            let error = text.parse::<Shard>().unwrap_err();
            assert!(error.contains(told), "{error}");
        }
        let shard: Shard = " 2 / 3 ".parse().unwrap();
        assert_eq!((shard.to_string().as_str(), shard.index(), shard.count()), ("2/3", 2, 3));
    }
}
