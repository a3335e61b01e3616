//! How long a driver may take before it is given up.

use std::time::Duration;

use curvelax_base::error::{Error, Result};

/// The variable that names another number of seconds.
const VARIABLE: &str = "CURVELAX_GPU_PATIENCE";
/// Drivers of hardware abandon a dispatch after some seconds themselves, and compile a kernel in seconds, or in a
/// minute on a busy machine. A dispatch on lavapipe lasts a fraction of a second, or longer while the driver compiles.
const PATIENCE: Duration = Duration::from_secs(120);

/// Time after which a dispatch is abandoned, and the compilation of a kernel if the CPU may take over: two minutes, or
/// the seconds in `CURVELAX_GPU_PATIENCE`.
///
/// # Errors
/// [`Error::Request`] if these are no positive number.
pub fn patience() -> Result<Duration> {
    std::env::var_os(VARIABLE).map_or(Ok(PATIENCE), |text| of(&text.to_string_lossy()))
}

fn of(text: &str) -> Result<Duration> {
    let seconds = text.trim().parse().ok().filter(|seconds| *seconds > 0.0);
    seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).ok_or_else(|| {
        Error::Request(format!("{VARIABLE}={text}: not a time; set it to a number of seconds above 0, or unset it"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patience_is_two_minutes_unless_the_variable_says_otherwise() {
        assert_eq!(PATIENCE, 2 * Duration::from_secs(60));
        assert_eq!(of("600").unwrap(), Duration::from_secs(600));
        assert_eq!(of(" 0.5 ").unwrap(), Duration::from_millis(500));
        for wrong in ["", "0", "-1", "nan", "inf", "1e30", "2m"] {
            let error = of(wrong).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{wrong}");
            assert!(error.to_string().starts_with(&format!("CURVELAX_GPU_PATIENCE={wrong}: not a time; ")), "{error}");
        }
    }

    #[test]
    fn the_documents_say_how_long_and_how_to_change_it() {
        assert_eq!(PATIENCE.as_secs() % 60, 0, "they count in minutes");
        let told = format!(
            "after {} minutes",
            ["no", "one", "two", "three", "four", "five"][PATIENCE.as_secs() as usize / 60]
        );
        let text = include_str!("../../../docs/internals/reliability.md");
        let row = |begin: &str| text.lines().find(|line| line.starts_with(begin)).expect("a row of the table");
        for begin in ["| hangs midway", "| never finishes compiling"] {
            assert!(row(begin).contains(&told), "{}", row(begin));
        }
        // The example names another time.
        let (_, rest) = text.split_once(&format!("`{VARIABLE}=")).expect("the variable");
        let (seconds, _) = rest.split_once('`').expect("an example");
        assert_ne!(of(seconds).unwrap(), PATIENCE);
        assert!(include_str!("../../../docs/running.md").contains(&told));
    }
}
