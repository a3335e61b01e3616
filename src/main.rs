//! The `curvelax` program: arguments → work → exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    curvelax::cli::main()
}
