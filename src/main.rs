//! The `curvelax` program: arguments → work → exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(curvelax::cli::main(std::env::args_os()))
}
