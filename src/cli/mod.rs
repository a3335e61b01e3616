//! The command line: one file per command, and the flags for the keys of the spec.
//!
//! Results go to files, one table goes to stdout, everything else to stderr. If the reader closes stdout early, the
//! program ends quietly.

mod adapters;
mod animate;
mod bench;
mod check;
mod completions;
mod convergence;
mod dry_run;
mod figure;
mod flags;
mod man;
mod merge;
mod paper;
mod parsers;
mod plot;
mod referee;
mod report_flags;
mod resume;
mod run;
mod signals;
mod unknown;

use std::{
    ffi::OsString,
    fmt::Display,
    io::{self, Write},
    path::Path,
};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use serde::Serialize;

use crate::{
    backend::gpu::abandoned,
    error::{Error, Result, with_short_words, without_controls},
    results::provenance::json,
};

const EXAMPLES: &str = "\
Examples:
  curvelax run --out ellipses
  curvelax resume ellipses
      resumes it if it was interrupted
  curvelax run --help";

/// Relaxes ensembles of closed plane curves by fourth-order geometric flows, on the GPU and the CPU.
#[derive(Parser)]
#[command(name = "curvelax", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Run(run::RunArgs),
    Resume(resume::ResumeArgs),
    Merge(merge::MergeArgs),
    Check(check::CheckArgs),
    Bench(bench::BenchArgs),
    Convergence(Box<convergence::ConvergenceArgs>),
    Figure(figure::FigureArgs),
    Plot(plot::PlotArgs),
    Animate(animate::AnimateArgs),
    Adapters(adapters::AdaptersArgs),
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
}

/// Parses `arguments`, the first of which is the program, runs the command, and returns the exit code. Wrong arguments
/// end the process.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = parse(arguments).unwrap_or_else(|error| error.exit());
    signals::outlive_full_files();
    let done = match cli.command {
        Command::Run(args) => run::run(args),
        Command::Resume(args) => resume::resume(args),
        Command::Merge(args) => merge::merge(args),
        Command::Check(args) => check::check(args),
        Command::Bench(args) => bench::bench(args),
        Command::Convergence(args) => convergence::convergence(*args),
        Command::Figure(args) => figure::figure(args),
        Command::Plot(args) => plot::plot(args),
        Command::Animate(args) => animate::animate(args),
        Command::Adapters(args) => adapters::adapters(args),
        Command::Completions(args) => completions::completions(args),
        Command::Man(args) => man::man(args),
    };
    let code = done.err().map_or(0, |error| {
        // What stopped a run says how to continue it, with the whole path.
        let message = error.to_string();
        note(&format!("error: {}", if error.exit_code() <= 2 { with_short_words(&message) } else { message }));
        error.exit_code()
    });
    if abandoned::is_any() {
        signals::exit(code);
    }
    code
}

/// Does the same as `Cli::try_parse_from`, but [explains](unknown::explain) unknown flags and
/// [suggests](unknown::suggest) values.
fn parse(arguments: impl IntoIterator<Item = impl Into<OsString>>) -> Result<Cli, clap::Error> {
    let arguments: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    let program = Cli::command();
    let parsed = program.clone().try_get_matches_from(&arguments).and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.map_err(|mut error| {
        unknown::explain(&mut error, &program, &arguments);
        unknown::suggest(&mut error);
        unknown::shorten(&mut error);
        error
    })
}

/// Checks the number of a flag, of which messages name the `unit`.
///
/// # Errors
/// [`Error::Request`] for a number out of range.
fn check_range<T: PartialOrd + Display>(key: &str, value: T, [least, most]: [T; 2], unit: &str) -> Result<()> {
    match (&least..=&most).contains(&&value) {
        true => Ok(()),
        false => Err(Error::value(key, value, "out of range", &format!("use {least} to {most}{unit}"))),
    }
}

/// Writes `text` to stdout; a closed stdout is not an error.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("cannot write to", Path::new("stdout"))(e)),
        _ => Ok(()),
    }
}

/// Writes `value` to stdout as JSON.
fn print_json(value: &impl Serialize) -> Result<()> {
    print(&json(value, "JSON")?)
}

/// Writes a line to stderr; if that fails, nothing can be done.
pub(crate) fn note(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", without_controls(line));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    /// The examples at the end of the help of a command.
    fn examples(help: &str) -> Vec<&str> {
        let (_, examples) = help.split_once("\nExamples:\n").unwrap_or_default();
        let lines = examples.lines().take_while(|line| !line.is_empty()).map(str::trim);
        lines.filter(|line| line.starts_with("curvelax ")).collect()
    }

    /// The words of a line as a shell passes them on, without redirections and the like.
    fn words(line: &str) -> impl Iterator<Item = &str> {
        line.split_whitespace().take_while(|word| !matches!(*word, ">" | "|" | "#"))
    }

    #[test]
    fn the_examples_of_every_help_parse() {
        let mut commands: Vec<String> = Cli::command().get_subcommands().map(|c| c.get_name().into()).collect();
        assert!(commands.len() >= 8, "{commands:?}");
        commands.push(String::new());
        for command in &commands {
            let asked = ["curvelax", command, "--help"];
            let help = parse(asked.into_iter().filter(|word| !word.is_empty())).err().expect("help").to_string();
            let examples = examples(&help);
            assert!(!examples.is_empty(), "no example in the help of `{command}`: {help}");
            assert!(examples[0].starts_with(&format!("curvelax {command}")), "{help}");
            for example in examples.iter().filter(|example| !example.ends_with("--help")) {
                if let Err(error) = parse(words(example)) {
                    panic!("`{example}` in the help of `{command}`: {error}");
                }
            }
        }
    }

    #[test]
    fn an_example_that_does_not_parse_is_found() {
        let help =
            "Usage\n\nExamples:\n  curvelax run --out a\n      what it does\n  curvelax run --uot b > c\n\nText.\n";
        assert_eq!(examples(help), ["curvelax run --out a", "curvelax run --uot b > c"]);
        assert!(parse(words(examples(help)[0])).is_ok() && parse(words(examples(help)[1])).is_err());
        assert_eq!(examples("Usage"), [""; 0]);
    }
}
