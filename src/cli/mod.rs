//! The command line: one file per command, and the flags that are the spec's keys.
//!
//! Results go to files, one table goes to stdout, everything else to stderr. A reader that closes stdout early
//! ends the program quietly.

mod adapters;
mod bench;
mod check;
mod convergence;
mod figure;
mod flags;
mod plot;
mod run;

use std::{
    ffi::OsString,
    io::{self, Write},
    path::Path,
    process::ExitCode,
};

use clap::{
    CommandFactory, FromArgMatches, Parser, Subcommand,
    error::{ContextKind, ContextValue, ErrorKind},
};

use crate::error::{Error, Result, nearest};

/// Relaxes ensembles of closed plane curves by fourth-order geometric flows, on the GPU and the CPU.
#[derive(Parser)]
#[command(name = "curvelax", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Run(Box<run::RunArgs>),
    Check(check::CheckArgs),
    Bench(bench::BenchArgs),
    Convergence(convergence::ConvergenceArgs),
    Figure(figure::FigureArgs),
    Plot(plot::PlotArgs),
    Adapters(adapters::AdaptersArgs),
}

/// Parses the arguments of the process, does what they ask, and returns the exit code.
pub fn main() -> ExitCode {
    let cli = parse(std::env::args_os()).unwrap_or_else(|error| error.exit());
    let done = match cli.command {
        Command::Run(args) => run::run(*args),
        Command::Check(args) => check::check(args),
        Command::Bench(args) => bench::bench(args),
        Command::Convergence(args) => convergence::convergence(args),
        Command::Figure(args) => figure::figure(args),
        Command::Plot(args) => plot::plot(args),
        Command::Adapters(args) => adapters::adapters(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            note(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// As `Cli::try_parse_from`, with the nearest flag also for a slip in a short word, which clap does not see.
fn parse(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Cli, clap::Error> {
    let command = Cli::command();
    let parsed = command.clone().try_get_matches_from(arguments).and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.map_err(|mut error| {
        if error.kind() == ErrorKind::UnknownArgument
            && error.get(ContextKind::SuggestedArg).is_none()
            && let Some(ContextValue::String(given)) = error.get(ContextKind::InvalidArg)
            && let Some(flag) = nearest_flag(&command, given)
        {
            error.remove(ContextKind::Suggested);
            error.insert(ContextKind::SuggestedArg, ContextValue::String(flag));
        }
        error
    })
}

fn nearest_flag(command: &clap::Command, given: &str) -> Option<String> {
    let flags = command.get_subcommands().flat_map(clap::Command::get_arguments).filter_map(clap::Arg::get_long);
    nearest(given.trim_start_matches('-'), flags).map(|flag| format!("--{flag}"))
}

/// Writes `text` to stdout; that the reader has gone away is no error.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("cannot write to", Path::new("stdout"))(e)),
        _ => Ok(()),
    }
}

/// Writes a line to stderr, where nothing can be done if that fails.
pub(crate) fn note(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_slip_in_a_short_flag_is_recognised() {
        let error = parse(["curvelax", "run", "--tua", "1"]).err().expect("an unknown flag").to_string();
        assert!(error.contains("a similar argument exists: '--tau'"), "{error}");
        assert!(!error.contains("-- --tua"), "{error}");
    }
}
