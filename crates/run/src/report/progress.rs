//! The progress of a command, on stderr: a bar with an estimate on a terminal. Elsewhere a run prints a line every ten
//! seconds, and a command of few long steps one per step.

use std::{
    io::{self, IsTerminal, Write},
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle, style::TemplateError};

use curvelax_base::text::{duration, plural};

/// Time between lines without a terminal.
const PERIOD: Duration = Duration::from_secs(10);
/// Time before the first estimate: members differ, and the first ones tell little.
const SETTLED: Duration = Duration::from_secs(2);
/// Resolution of the bar.
const TICKS: u64 = 10_000;

/// Shows progress in the way that suits stderr.
pub enum Progress {
    /// Shows nothing.
    Quiet,
    /// On a terminal.
    Bar(ProgressBar, ProgressPace),
    /// To a function, with the members, or runs of members, that have ended, all of them, and the share of the work
    /// that is done.
    Callback(Box<dyn FnMut(u64, u64, f64)>),
    /// In a file or a pipe, with the start of the run and the periods that had passed at the last line.
    Lines(Instant, u64, ProgressPace),
}

/// How fast the work is done: since the first share that was shown, because a resumed run did that part earlier.
#[derive(Default)]
pub struct ProgressPace {
    first: Option<(Instant, f64)>,
}

impl ProgressPace {
    /// The time left when `share` of the work is done, if there is an estimate.
    fn left(&mut self, share: f64) -> Option<Duration> {
        let (began, before) = *self.first.get_or_insert_with(|| (Instant::now(), share));
        time_left(began.elapsed(), before, share)
    }
}

/// The time left if the share of the work that is done went from `before` to `share` in the time `elapsed`. None as
/// long as nothing is known, and at the end, where it would be 0.
fn time_left(elapsed: Duration, before: f64, share: f64) -> Option<Duration> {
    if elapsed < SETTLED || share <= before {
        return None;
    }
    let left = Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 - share) / (share - before)).ok();
    left.filter(|left| *left >= Duration::from_secs(1))
}

impl Progress {
    /// Chooses the variant.
    pub fn new(quiet: bool) -> Progress {
        if quiet {
            return Progress::Quiet;
        }
        let lines = || Progress::Lines(Instant::now(), 0, ProgressPace::default());
        if !io::stderr().is_terminal() {
            return lines();
        }
        let colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        let bar = ProgressBar::new(TICKS);
        bar.set_style(style(colour).unwrap_or_else(|_| ProgressStyle::default_bar()));
        // A terminal that cannot go back in a line, such as TERM=dumb, shows no bars.
        if bar.is_hidden() { lines() } else { Progress::Bar(bar, ProgressPace::default()) }
    }

    /// `done` of `total` members, or runs of members, have ended; `share` ∈ [0, 1] of the work is done.
    pub fn show(&mut self, done: u64, total: u64, share: f64, what: &str) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar, pace) => show_bar(bar, pace, &ended(done, total, what), share.clamp(0.0, 1.0)),
            Progress::Callback(tell) => tell(done, total, share),
            Progress::Lines(began, periods, pace) => {
                let share = share.clamp(0.0, 1.0);
                let left = pace.left(share);
                if is_due(periods, began.elapsed()) {
                    let _ = writeln!(io::stderr().lock(), "{}", line(&ended(done, total, what), share, left));
                }
            }
        }
    }

    /// `done` of `total` steps have ended, and `what` is next. Without a bar every step has a line: a step may take
    /// long, and the line shows which one is running.
    pub fn step(&mut self, done: usize, total: usize, what: &str) {
        match self {
            Progress::Quiet | Progress::Callback(_) => {}
            Progress::Bar(bar, pace) => show_bar(bar, pace, what, done as f64 / total.max(1) as f64),
            Progress::Lines(..) => {
                let _ = writeln!(io::stderr().lock(), "{} of {total}: {what}", done + 1);
            }
        }
    }

    /// Removes the bar.
    pub fn finish(self) {
        if let Progress::Bar(bar, _) = self {
            bar.finish_and_clear();
        }
    }
}

/// Whether a line is due `elapsed` after the start of the run, if so many `periods` had passed at the last look. Lines
/// are at even times; a run that ends before the first has none.
fn is_due(periods: &mut u64, elapsed: Duration) -> bool {
    let now = elapsed.as_secs() / PERIOD.as_secs();
    std::mem::replace(periods, now) < now
}

fn style(colour: bool) -> Result<ProgressStyle, TemplateError> {
    let bar = if colour { "{bar:32.cyan/dim}" } else { "{bar:32}" };
    let style = ProgressStyle::with_template(&format!("{bar} {{percent:>3}} %  {{msg}}"))?;
    Ok(style.progress_chars("━━─"))
}

/// Shows `what` and the time left. The bar's own estimate is 0 as long as it knows nothing.
fn show_bar(bar: &ProgressBar, pace: &mut ProgressPace, what: &str, share: f64) {
    let left = pace.left(share).map_or(String::new(), |left| format!("  {:#} left", HumanDuration(left)));
    bar.set_message(format!("{what}{left}"));
    bar.set_position((share * TICKS as f64) as u64);
}

fn line(ended: &str, share: f64, left: Option<Duration>) -> String {
    let left = left.map_or(String::new(), |left| format!(", about {} left", duration(left.as_secs_f64())));
    format!("{ended}, {:.1} %{left}", 100.0 * share)
}

fn ended(done: u64, total: u64, what: &str) -> String {
    format!("{done} of {total} {}", plural(total, what))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_estimates_what_is_left() {
        let left = time_left(Duration::from_secs(30), 0.0, 0.25);
        let line = |done, total, share, left| line(&ended(done, total, "member"), share, left);
        assert_eq!(line(64, 256, 0.25, left), "64 of 256 members, 25.0 %, about 1 min 30 s left");
        assert_eq!(line(0, 256, 0.0, None), "0 of 256 members, 0.0 %");
        let left = time_left(Duration::from_secs(30), 0.0, 0.5);
        assert_eq!(line(0, 1, 0.5, left), "0 of 1 member, 50.0 %, about 30.0 s left");
    }

    #[test]
    fn nothing_is_estimated_from_nothing_or_from_what_was_done_before() {
        let left = |milliseconds, before, share| time_left(Duration::from_millis(milliseconds), before, share);
        // At the start, while nothing is done, and at the end.
        for (milliseconds, before, share) in [(0, 0.0, 0.0), (1999, 0.0, 0.1), (60_000, 0.4, 0.4), (60_000, 0.0, 1.0)] {
            assert_eq!(left(milliseconds, before, share), None, "{milliseconds} ms, {before} to {share}");
        }
        assert_eq!(left(10_000, 0.0, 0.5), Some(Duration::from_secs(10)));
        // A resumed run that began at a half.
        assert_eq!(left(10_000, 0.5, 0.75), Some(Duration::from_secs(10)));
        assert_eq!(left(10_000, 0.0, f64::MIN_POSITIVE), None, "longer than a duration can be");
    }

    #[test]
    fn a_bar_starts_without_an_estimate() {
        let (bar, mut pace) = (ProgressBar::hidden(), ProgressPace::default());
        for share in [0.0, 1e-9, 0.3] {
            show_bar(&bar, &mut pace, "0 of 2 members", share);
            assert_eq!(bar.message(), "0 of 2 members", "{share}");
        }
        // How much is left depends on how busy the machine is.
        pace.first = Instant::now().checked_sub(2 * SETTLED).map(|began| (began, 0.0));
        show_bar(&bar, &mut pace, "1 of 2 members", 0.5);
        let message = bar.message();
        assert!(message.starts_with("1 of 2 members  ") && message.ends_with(" left"), "{message}");
    }

    #[test]
    fn a_line_is_due_every_ten_seconds_and_not_before() {
        let mut periods = 0;
        let mut at = |milliseconds| is_due(&mut periods, Duration::from_millis(milliseconds));
        let due: Vec<u64> = (0..60_000).step_by(70).filter(|elapsed| at(*elapsed)).collect();
        assert_eq!(due, [10_010, 20_020, 30_030, 40_040, 50_050]);
        // Long dispatches skip lines, which are not printed later.
        let due: Vec<u64> = [95_000, 99_999, 100_000].into_iter().filter(|elapsed| at(*elapsed)).collect();
        assert_eq!(due, [95_000, 100_000]);
    }

    #[test]
    fn the_bar_is_well_formed() {
        assert!(style(true).is_ok() && style(false).is_ok());
    }
}
