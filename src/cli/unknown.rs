//! Flags that a command does not have, and values that a flag does not have: suggestions of what was meant.

use std::{ffi::OsString, iter};

use clap::{
    Command,
    builder::StyledStr,
    error::{ContextKind, ContextValue, ErrorKind},
};

use crate::error::{MAX_VALUE, nearest, shortened};

/// Maximum flags of a command that are listed; the help has more.
const LISTED: usize = 16;

/// If `error` is about an unknown flag, adds which commands have it, or which flag of this command is similar. clap
/// misses slips in short words, or takes them for parts of long ones, and suggests similar words if the flag belongs to
/// another command.
pub fn explain(error: &mut clap::Error, program: &Command, arguments: &[OsString]) {
    let Some(ContextValue::String(given)) = error.get(ContextKind::InvalidArg) else { return };
    let Some(word) = given.strip_prefix("--").filter(|_| error.kind() == ErrorKind::UnknownArgument) else { return };
    let word = word.to_string();
    // The program itself has no flag with a value that could come before the command.
    let called = arguments.iter().skip(1).find_map(|argument| program.find_subcommand(argument));
    let command = called.unwrap_or(program);
    let owners: Vec<&str> = program
        .get_subcommands()
        .filter(|command| flags(command).any(|flag| flag == word))
        .map(Command::get_name)
        .collect();
    if !owners.is_empty() {
        // If the command has the flag, it was named after the flag.
        let called = called.filter(|command| !owners.contains(&command.get_name()));
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(belongs(&word, &owners, called)));
    } else if let Some(near) = nearest(&word, flags(command)) {
        error.remove(ContextKind::Suggested);
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::SuggestedArg, ContextValue::String(format!("--{near}")));
    }
}

/// If `error` is about a value that is none of several, adds the nearest of these where clap finds none: it misses two
/// letters swapped in a short one.
pub fn suggest(error: &mut clap::Error) {
    let Some(ContextValue::String(given)) = error.get(ContextKind::InvalidValue) else { return };
    let Some(ContextValue::Strings(valid)) = error.get(ContextKind::ValidValue) else { return };
    let near = nearest(given, valid.iter().map(String::as_str)).map(str::to_owned);
    if let (Some(near), None) = (near, error.get(ContextKind::SuggestedValue)) {
        error.insert(ContextKind::SuggestedValue, ContextValue::String(near));
    }
}

/// Shortens the values that `error` echoes.
pub fn shorten(error: &mut clap::Error) {
    let is_long = |text: &str| text.chars().count() > MAX_VALUE;
    let short = |text: &String| shortened(text, MAX_VALUE);
    let long: Vec<(ContextKind, ContextValue)> = error
        .context()
        .filter_map(|(kind, value)| {
            let short = match value {
                ContextValue::String(text) if is_long(text) => ContextValue::String(short(text)),
                ContextValue::Strings(all) if all.iter().any(|text| is_long(text)) => {
                    ContextValue::Strings(all.iter().map(short).collect())
                }
                // How to give the value itself, which is in the message already.
                ContextValue::StyledStrs(_) if kind == ContextKind::Suggested && is_value(error) => ContextValue::None,
                _ => return None,
            };
            Some((kind, short))
        })
        .collect();
    for (kind, value) in long {
        error.insert(kind, value);
    }
}

/// Whether `error` is about an overlong argument.
fn is_value(error: &clap::Error) -> bool {
    matches!(error.get(ContextKind::InvalidArg), Some(ContextValue::String(given)) if given.chars().count() > MAX_VALUE)
}

fn flags(command: &Command) -> impl Iterator<Item = &str> {
    command.get_arguments().filter_map(clap::Arg::get_long)
}

/// The commands to which a flag belongs, and the description and flags of the command that was `called`.
fn belongs(word: &str, owners: &[&str], called: Option<&Command>) -> Vec<StyledStr> {
    let owners = quoted(owners.iter().map(|owner| (*owner).to_string()));
    let Some(command) = called else { return vec![format!("'--{word}' goes after a command: {owners}").into()] };
    let name = command.get_name();
    let own: Vec<String> = flags(command).map(|flag| format!("--{flag}")).collect();
    let takes = match own.len() {
        0 => format!("'{name}' takes no flags; "),
        1..=LISTED => format!("'{name}' takes {}; ", quoted(own.into_iter())),
        _ => String::new(),
    };
    let does = command.get_about().map(|about| format!("'{name}': {about}").into());
    iter::once(format!("{takes}'--{word}' belongs to {owners}").into()).chain(does).collect()
}

fn quoted(words: impl Iterator<Item = String>) -> String {
    words.map(|word| format!("'{word}'")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::CommandFactory;

    use super::*;
    use crate::cli::{Cli, parse};

    fn said(arguments: &[&str]) -> String {
        parse([&["curvelax"], arguments].concat()).err().expect("an unknown flag").to_string()
    }

    #[test]
    fn a_slip_in_a_short_flag_is_recognised() {
        let error = said(&["run", "--tua", "1"]);
        assert!(error.contains("a similar argument exists: '--tau'"), "{error}");
        assert!(!error.contains("-- --tua"), "{error}");
    }

    #[test]
    fn a_slip_in_a_short_value_is_recognised() {
        for (slip, near) in [("pgn", Some("png")), ("pngg", Some("png")), ("svg,pfd", Some("pdf")), ("tiff", None)] {
            let error = said(&["plot", "out", "--format", slip]);
            let tip = near.map(|near| format!("a similar value exists: '{near}'"));
            assert!(error.contains("possible values: svg, png, pdf") && error.contains("invalid value"), "{error}");
            assert_eq!(error.contains("similar"), tip.is_some(), "{slip}: {error}");
            assert!(tip.is_none_or(|tip| error.contains(&tip)), "{slip}: {error}");
        }
    }

    #[test]
    fn a_slip_is_mended_by_flags_of_the_command_only() {
        for (command, slip) in [("check", "--tua"), ("plot", "--sede"), ("adapters", "--pionts")] {
            let error = said(&[command, slip]);
            assert!(!error.contains("similar"), "{error}");
        }
    }

    #[test]
    fn a_flag_of_another_command_is_named_as_such() {
        let program = Cli::command();
        let all: BTreeSet<&str> = program.get_subcommands().flat_map(flags).collect();
        let mut pairs = 0;
        for command in program.get_subcommands() {
            let own: BTreeSet<&str> = flags(command).collect();
            for flag in all.difference(&own) {
                for word in [format!("--{flag}"), format!("--{flag}=1")] {
                    let error = said(&[command.get_name(), &word]);
                    assert!(error.contains(&format!("'--{flag}' belongs to '")), "{error}");
                    assert!(!error.contains("similar") && !error.contains("as a value"), "{error}");
                    pairs += 1;
                }
            }
        }
        assert!(pairs > 500, "{pairs}");
    }

    #[test]
    fn a_back_end_for_check_is_answered_with_what_check_does() {
        let error = said(&["check", "--backend", "gpu"]);
        let parts =
            ["'--adapter'", "'--backend' belongs to 'run', 'resume', 'bench', 'convergence'", "Compare the GPU"];
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }

    #[test]
    fn a_flag_before_the_command_is_sent_behind_it() {
        for arguments in [&["--json"][..], &["--curves=3"], &["--curves", "3", "run"]] {
            let error = said(arguments);
            assert!(error.contains("goes after a command: 'run'") && !error.contains("similar"), "{error}");
        }
    }
}
