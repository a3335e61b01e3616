//! `curvelax completions`: a script with which a shell completes commands and flags.

use clap::CommandFactory;
use clap_complete::{Shell, generate};

use super::{Cli, print};
use crate::error::Result;

const EXAMPLES: &str = "\
Examples:
  curvelax completions bash > ~/.local/share/bash-completion/completions/curvelax
  curvelax completions zsh > ~/.zfunc/_curvelax
  curvelax completions fish > ~/.config/fish/completions/curvelax.fish";

/// Print completions of commands and flags for a shell.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Prints the script.
pub fn completions(args: CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut Cli::command(), "curvelax", &mut script);
    print(&String::from_utf8_lossy(&script))
}
