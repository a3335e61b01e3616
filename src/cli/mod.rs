//! The command line: one file per command, and the flags that are the spec's keys.
//!
//! Results go to files, one table goes to stdout, everything else to stderr. A reader that closes stdout early
//! ends the program quietly.

mod adapters;
mod check;
mod flags;
mod run;

use std::{
    io::{self, Write},
    path::Path,
    process::ExitCode,
};

use clap::{Parser, Subcommand};

use crate::error::{Error, Result};

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
    Adapters(adapters::AdaptersArgs),
}

/// Parses the arguments of the process, does what they ask, and returns the exit code.
pub fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Run(args) => run::run(*args),
        Command::Check(args) => check::check(args),
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
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }
}
