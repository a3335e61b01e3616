//! The progress of a command, on stderr: a bar with an estimate on a terminal. Elsewhere a run prints a line every ten
//! seconds, and a command of few long steps one per step.

use std::{
    fmt,
    io::{self, IsTerminal, Write},
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle, style::TemplateError};

use crate::text::{duration, plural};

/// Time between lines without a terminal.
const PERIOD: Duration = Duration::from_secs(10);
/// Resolution of the bar.
const TICKS: u64 = 10_000;

/// Shows progress in the way that suits stderr.
pub enum Progress {
    /// Shows nothing.
    Quiet,
    /// On a terminal.
    Bar(ProgressBar),
    /// To a function, with the members that have ended, all members, and the share of the work that is done.
    Told(Box<dyn FnMut(u64, u64, f64)>),
    /// In a file or a pipe, with the start of the run.
    Lines(Instant, ProgressLines),
}

/// Lines at even times; none for a run that ends before the first.
#[derive(Default)]
pub struct ProgressLines {
    /// Periods that had passed at the last line.
    periods: u64,
}

impl Progress {
    /// Chooses the variant.
    pub fn new(quiet: bool) -> Progress {
        if quiet {
            return Progress::Quiet;
        }
        if !io::stderr().is_terminal() {
            return Progress::Lines(Instant::now(), ProgressLines::default());
        }
        let colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        let bar = ProgressBar::new(TICKS);
        bar.set_style(style(colour).unwrap_or_else(|_| ProgressStyle::default_bar()));
        // A terminal that cannot go back in a line, such as TERM=dumb, shows no bars.
        if bar.is_hidden() { Progress::Lines(Instant::now(), ProgressLines::default()) } else { Progress::Bar(bar) }
    }

    /// `done` of `total` members have ended; `share` ∈ [0, 1] of the work is done.
    pub fn show(&mut self, done: u64, total: u64, share: f64) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                bar.set_message(members(done, total));
                bar.set_position((share.clamp(0.0, 1.0) * TICKS as f64) as u64);
            }
            Progress::Told(tell) => tell(done, total, share),
            Progress::Lines(began, lines) => {
                if let Some(line) = lines.at(began.elapsed(), done, total, share) {
                    let _ = writeln!(io::stderr().lock(), "{line}");
                }
            }
        }
    }

    /// `done` of `total` steps have ended, and `what` is next. Without a bar every step has a line: a step may take
    /// long, and the line shows which one is running.
    pub fn step(&self, done: usize, total: usize, what: &str) {
        match self {
            Progress::Quiet | Progress::Told(_) => {}
            Progress::Bar(bar) => {
                bar.set_message(what.to_string());
                bar.set_position(TICKS * done as u64 / total.max(1) as u64);
            }
            Progress::Lines(..) => {
                let _ = writeln!(io::stderr().lock(), "{} of {total}: {what}", done + 1);
            }
        }
    }

    /// Removes the bar.
    pub fn finish(self) {
        if let Progress::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

impl ProgressLines {
    /// The line due `elapsed` after the start of the run, if any.
    fn at(&mut self, elapsed: Duration, done: u64, total: u64, share: f64) -> Option<String> {
        let periods = elapsed.as_secs() / PERIOD.as_secs();
        let due = periods > self.periods;
        self.periods = periods;
        due.then(|| line(done, total, share, elapsed))
    }
}

fn style(colour: bool) -> Result<ProgressStyle, TemplateError> {
    let bar = if colour { "{bar:32.cyan/dim}" } else { "{bar:32}" };
    let style = ProgressStyle::with_template(&format!("{bar} {{percent:>3}} %  {{msg}}{{left}}"))?;
    Ok(style.progress_chars("━━─").with_key("left", left))
}

/// Writes the time left, once there is something to estimate it from.
fn left(state: &ProgressState, text: &mut dyn fmt::Write) {
    if state.pos() > 0 {
        // The bar has no place for a failure.
        let _ = write!(text, "  {:#} left", HumanDuration(state.eta()));
    }
}

fn line(done: u64, total: u64, share: f64, elapsed: Duration) -> String {
    let share = share.clamp(0.0, 1.0);
    let estimate = elapsed.as_secs_f64() * (1.0 - share) / share;
    let left = if share > 0.0 { format!(", about {} left", duration(estimate)) } else { String::new() };
    format!("{}, {:.1} %{left}", members(done, total), 100.0 * share)
}

fn members(done: u64, total: u64) -> String {
    format!("{done} of {total} {}", plural(total, "member"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_estimates_what_is_left() {
        let elapsed = Duration::from_secs(30);
        assert_eq!(line(64, 256, 0.25, elapsed), "64 of 256 members, 25.0 %, about 1 min 30 s left");
        assert_eq!(line(0, 256, 0.0, elapsed), "0 of 256 members, 0.0 %");
        assert_eq!(line(0, 1, 0.5, elapsed), "0 of 1 member, 50.0 %, about 30.0 s left");
    }

    #[test]
    fn a_line_is_due_every_ten_seconds_and_not_before() {
        let mut lines = ProgressLines::default();
        let at = |lines: &mut ProgressLines, milliseconds| {
            lines.at(Duration::from_millis(milliseconds), 1, 4, 0.5).is_some()
        };
        let due: Vec<u64> = (0..60_000).step_by(70).filter(|elapsed| at(&mut lines, *elapsed)).collect();
        assert_eq!(due, [10_010, 20_020, 30_030, 40_040, 50_050]);
        // Long dispatches skip lines, which are not printed later.
        let due: Vec<u64> = [95_000, 99_999, 100_000].into_iter().filter(|elapsed| at(&mut lines, *elapsed)).collect();
        assert_eq!(due, [95_000, 100_000]);
    }

    #[test]
    fn the_bar_is_well_formed() {
        assert!(style(true).is_ok() && style(false).is_ok());
    }
}
