//! `curvelax man`: the man page, from the same definitions as the help.

use std::io;

use clap::{Command, CommandFactory};
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

/// Prints the page: a description of the program, then each command with its flags.
pub fn man(ManArgs {}: ManArgs) -> Result<()> {
    let mut program = Cli::command();
    program.build();
    let page = page(&program).map_err(|e| Error::Failed(format!("cannot write the man page: {e}")))?;
    print(&page)
}

fn page(program: &Command) -> io::Result<String> {
    let (man, mut head) = (Man::new(program.clone()), Vec::new());
    man.render_title(&mut head)?;
    man.render_name_section(&mut head)?;
    man.render_synopsis_section(&mut head)?;
    man.render_description_section(&mut head)?;
    man.render_subcommands_section(&mut head)?;
    let mut page = String::from_utf8_lossy(&head).into_owned();
    for name in program.get_subcommands().map(Command::get_name) {
        // It has no separate page.
        page = page.replace(&format!("curvelax\\-{name}(1)"), &format!("curvelax {name}"));
    }
    for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
        let (man, mut part) = (Man::new(command.clone()), Vec::new());
        man.render_synopsis_section(&mut part)?;
        man.render_description_section(&mut part)?;
        man.render_options_section(&mut part)?;
        let name = command.get_name();
        page += &format!(".SH \"curvelax {name}\"\n{}", String::from_utf8_lossy(&part).replace(".SH ", ".SS "));
        let examples = command.get_after_help().map_or(String::new(), |text| literal(&text.to_string()));
        page += &format!(".SS EXAMPLES\n.nf\n{}\n.fi\n", examples.trim_start_matches("Examples:\n"));
    }
    Ok(page)
}

/// `text` as literal characters in roff.
fn literal(text: &str) -> String {
    let lines = text.lines().map(|line| line.replace('\\', "\\e").replace('-', "\\-"));
    // A line that begins with a dot or a quote would be a request.
    let lines = lines.map(|line| if line.starts_with(['.', '\'']) { format!("\\&{line}") } else { line });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_roff_would_take_for_itself_is_escaped() {
        assert_eq!(literal("a \\ --b\n.c\n'd"), "a \\e \\-\\-b\n\\&.c\n\\&'d");
    }

    #[test]
    fn the_page_refers_to_no_page_that_is_not_there() {
        let mut program = Cli::command();
        program.build();
        let page = page(&program).unwrap();
        assert!(!page.contains("(1)"), "{page}");
        assert!(page.contains("\n  curvelax run \\-\\-out ellipses\n"), "{page}");
    }
}
