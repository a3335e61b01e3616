//! A flag for each key of the spec: the same names, the same values; a flag overrides the file.
//!
//! Values are only parsed here. Ranges are checked once, on the resolved spec, so that numbers from the file and from
//! flags pass the same checks.

use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches, builder::ValueParser};

use super::parsers::{shard, word_of};
pub(super) use crate::ensemble::request::spec::heading::{EVOLUTION, MACHINE, METHOD, OUTPUT};
use crate::{
    ensemble::{
        Spec,
        request::{
            spec::SpecKey,
            sweep::{self, SweepAxis},
            value::Takes,
        },
    },
    error::{Error, Result, echo},
};

/// The flag that stands for several keys, and the first of them in the help after it.
const ACCURATE: &str = "accurate";
const AFTER_ACCURATE: &str = "refine";

/// The keys of [`Spec`] that the user gave as flags, with their words.
pub struct SpecFlags {
    given: Vec<(&'static SpecKey, Vec<String>)>,
    accurate: bool,
}

/// The flag of a key.
fn flag(key: &'static SpecKey) -> Arg {
    let arg = Arg::new(&*key.name).long(&*key.name).value_name(key.value).help(key.help()).help_heading(key.heading);
    let checked = ValueParser::from(|word: &str| (key.check)(word).map(|()| word.to_owned()));
    match (key.takes, key.missing) {
        // The name of a Slurm job array stands for two numbers.
        _ if key.name == "shard" => arg.value_parser(shard).allow_hyphen_values(true),
        (Takes::Number, Some(missing)) => {
            arg.value_parser(checked).num_args(0..=1).default_missing_value(missing).allow_negative_numbers(true)
        }
        (Takes::Number, None) => arg.value_parser(checked).allow_hyphen_values(true),
        (Takes::Text, _) => arg.value_parser(checked),
        (Takes::Word { names, gone }, _) => arg.value_parser(word_of(names, gone, key.check)),
        (Takes::Switch, _) => {
            let arg = arg.num_args(0..=1).require_equals(true).default_missing_value("true").hide_possible_values(true);
            arg.value_parser(word_of(&["true", "false"], &[], key.check))
        }
        (Takes::List, _) => {
            arg.value_parser(checked).value_delimiter(',').action(ArgAction::Append).allow_hyphen_values(true)
        }
        (Takes::Repeated, _) => arg.value_parser(checked).action(ArgAction::Append).allow_hyphen_values(true),
    }
}

impl clap::Args for SpecFlags {
    fn augment_args(command: Command) -> Command {
        let accurate = Arg::new(ACCURATE).long(ACCURATE).action(ArgAction::SetTrue).help_heading(EVOLUTION);
        let accurate = accurate.help(
            "What we recommend for numbers to publish: --adaptive --pull auto --omega auto --t-end auto --stop-when-relaxed --refine; vesicles (--conserve area,length) run without --stop-when-relaxed. Each can still be set on its own [default: off]",
        );
        Spec::table().iter().fold(command, |command, key| {
            let command = if key.name == AFTER_ACCURATE { command.arg(accurate.clone()) } else { command };
            command.arg(flag(key))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for SpecFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let words = |key: &'static SpecKey| Some((key, matches.get_many::<String>(&key.name)?.cloned().collect()));
        Ok(SpecFlags { given: Spec::table().iter().filter_map(words).collect(), accurate: matches.get_flag(ACCURATE) })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl SpecFlags {
    /// Checks that no key is given by two flags. A sweep may replace a single value of the spec file.
    ///
    /// # Errors
    /// [`Error::Request`] for a key that is swept twice, or swept and given: the values of one flag would be lost.
    pub fn check_sweeps(&self) -> Result<()> {
        let words = self.given.iter().filter(|(key, _)| key.name == "sweep").flat_map(|(_, words)| words);
        let axes: Vec<SweepAxis> = words.filter_map(|word| word.parse().ok()).collect();
        let twice = |(i, axis): (usize, &SweepAxis)| axes[..i].iter().any(|other| other.key == axis.key);
        if let Some((_, SweepAxis { key, .. })) = axes.iter().enumerate().find(|at| twice(*at)) {
            let key = echo(key);
            return Err(Error::Request(format!(
                "--sweep {key}: given twice; give all values at once, --sweep {key}=V1,V2"
            )));
        }
        let given = self.given();
        axes.iter().try_for_each(|axis| sweep::check_not_given(&axis.key, &given))
    }

    /// The keys given as flags, without those that are swept.
    fn given(&self) -> Vec<String> {
        self.given.iter().map(|(key, _)| key.name.clone()).filter(|name| name != "sweep").collect()
    }

    fn has(&self, name: &str) -> bool {
        self.given.iter().any(|(key, _)| key.name == name)
    }

    /// Replaces in `spec` the values given as flags.
    ///
    /// # Errors
    /// [`Error::Request`] for a value that its key does not allow.
    pub fn overlay(self, spec: &mut Spec) -> Result<()> {
        // A flag overrides the file, including the key that it excludes.
        if self.has("tau") || self.has("adaptive") {
            (spec.tau, spec.adaptive) = (None, None);
        }
        if self.has("relax-to") || self.has("relax-at") {
            (spec.relax_to, spec.relax_at) = (None, None);
        }
        let accurate = self.accurate.then(|| self.given());
        spec.omitted.curves &= !self.has("curves");
        spec.omitted.amplitude &= !self.has("amplitude");
        for (key, words) in self.given {
            (key.set)(spec, &words).map_err(|problem| Error::Request(format!("--{}: {problem}", key.name)))?;
        }
        // Last, since it depends on what is kept.
        if let Some(given) = accurate {
            spec.make_accurate(&given);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use clap::Args;

    fn command() -> clap::Command {
        SpecFlags::augment_args(clap::Command::new("test"))
    }

    fn parse(arguments: &[&str]) -> Spec {
        let matches = command().no_binary_name(true).try_get_matches_from(arguments).unwrap();
        let mut spec = Spec::default();
        SpecFlags::from_arg_matches(&matches).unwrap().overlay(&mut spec).unwrap();
        spec
    }

    #[test]
    fn the_flags_are_the_keys_of_the_spec() {
        let flags: BTreeSet<String> = command().get_arguments().map(|a| a.get_long().unwrap().to_owned()).collect();
        // One flag stands for several keys.
        assert_eq!(flags, Spec::keys().into_iter().chain(["accurate".into()]).collect());
    }

    #[test]
    fn the_help_states_the_defaults_of_the_spec() {
        let filled = Spec::default().validate().unwrap();
        let defaults: toml::Table = toml::from_str(&filled.to_toml().unwrap()).unwrap();
        for argument in command().get_arguments() {
            let help = argument.get_help().unwrap().to_string();
            let stated = help.rsplit_once("[default: ").expect("a default").1.trim_end_matches(']');
            let Some(value) = defaults.get(argument.get_long().unwrap()) else { continue };
            let expected = match value {
                toml::Value::String(text) => text.clone(),
                toml::Value::Float(number) => number.to_string(),
                toml::Value::Array(list) if list.is_empty() => "off".into(),
                other => other.to_string(),
            };
            let stated =
                [" with --", "; "].into_iter().fold(stated, |text, end| text.split(end).next().unwrap_or(text));
            assert_eq!(stated, expected, "--{}", argument.get_id());
        }
    }

    #[test]
    fn every_flag_replaces_its_key() {
        let spec = parse(
            "--curves 3 --outlines 4 --group-by kind --points 7 --seed 9 --sampling points --amplitude 0.5 --modes 1..=2 --decay 2 --perturbation gaussian --design lhs --flow willmore --energy cos:4,0.03 --diffusivity cos:4,0.5 --drive 0.5 --conserve area,length --conserve-at 4,9 --reduced-area 0.7 --mobility 2 --units um,h \
             --tau 1e-6 --t-end 1 --interpolate spline --rounding 0.01 --omega 0 --no-redistribution --pull 3 --form auto --solver direct --order lexicographic \
             --tolerance 1e-4 \
             --sor 1.5 --max-sweeps 10 --backend cpu --adapter a --precision f32 --relax-to 0.1 --stop-when-relaxed \
             --refine --accuracy 0.01 --event convex=k_min>=0 --series 0.1 --snapshots 0,1 --store zarr --tables parquet --only 1,2 --shard 0/2 --threads 2 --common-random-numbers \
             --sweep phase=1,2"
                .split_whitespace()
                .collect::<Vec<_>>()
                .as_slice(),
        );
        let (given, default) = (spec.to_toml().unwrap(), Spec::default().to_toml().unwrap());
        let default: BTreeSet<&str> = default.lines().filter(|line| !line.starts_with("shape")).collect();
        let kept: Vec<&str> = given.lines().filter(|line| default.contains(line)).collect();
        assert_eq!(kept, [""; 0]);
        // One key of each pair that excludes the other is left out.
        assert_eq!(given.lines().filter(|line| line.contains(" = ")).count(), Spec::keys().len() - 2);
        assert!(given.ends_with("[sweep]\nphase = [1, 2]\n"), "{given}");
    }

    #[test]
    fn a_flag_also_replaces_the_key_of_the_file_that_it_stands_instead_of() {
        let file = || Spec::from_toml("tau = 1e-4\nrelax-to = 0.1").unwrap();
        let overlaid = |arguments: &[&str], mut spec: Spec| {
            let matches = command().no_binary_name(true).try_get_matches_from(arguments).unwrap();
            SpecFlags::from_arg_matches(&matches).unwrap().overlay(&mut spec).unwrap();
            spec
        };
        let spec = overlaid(&["--adaptive", "--relax-at", "0.01"], file());
        assert_eq!((spec.tau, spec.adaptive, spec.relax_to, spec.relax_at), (None, Some(1e-3), None, Some(0.01)));
        let spec = overlaid(&["--tau", "1e-5", "--relax-to", "0.2"], spec);
        assert_eq!((spec.tau, spec.adaptive, spec.relax_to, spec.relax_at), (Some(1e-5.into()), None, Some(0.2), None));
        assert_eq!(overlaid(&[], file()), file());
    }

    #[test]
    fn a_flag_that_is_not_given_replaces_nothing() {
        assert_eq!(parse(&[]), Spec::default());
    }

    #[test]
    fn a_switch_can_undo_the_file() {
        let mut spec = Spec { stop_when_relaxed: Some(true), ..Spec::default() };
        let matches = command().no_binary_name(true).try_get_matches_from(["--stop-when-relaxed=false"]).unwrap();
        SpecFlags::from_arg_matches(&matches).unwrap().overlay(&mut spec).unwrap();
        assert_eq!(spec.stop_when_relaxed, Some(false));
    }
}
