//! `curvelax man`: the man page, from the same definitions as the help.

use clap::CommandFactory;
use clap_mangen::Man;

use super::{Cli, print};
use crate::error::{Error, Result};

const EXAMPLES: &str = "\
Examples:
  curvelax man > ~/.local/share/man/man1/curvelax.1
  curvelax man | man -l -";

/// Print the man page: all commands with their flags.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct ManArgs {}

/// Prints the page: that of the program, then the flags of each command.
pub fn man(ManArgs {}: ManArgs) -> Result<()> {
    let failed = |e| Error::Failed(format!("cannot write the man page: {e}"));
    let mut page = Vec::new();
    let mut program = Cli::command();
    program.build();
    Man::new(program.clone()).render(&mut page).map_err(failed)?;
    for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
        let (man, mut part) = (Man::new(command.clone()), Vec::new());
        man.render_synopsis_section(&mut part).map_err(failed)?;
        man.render_description_section(&mut part).map_err(failed)?;
        man.render_options_section(&mut part).map_err(failed)?;
        man.render_extra_section(&mut part).map_err(failed)?;
        // Where a command has its page to itself these are its sections.
        let part = String::from_utf8_lossy(&part).replace(".SH ", ".SS ");
        page.extend(format!(".SH \"curvelax {}\"\n{part}", command.get_name()).bytes());
    }
    print(&String::from_utf8_lossy(&page))
}
