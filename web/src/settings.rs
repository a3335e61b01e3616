//! What the page lets one set, as the program's spec and as its command line.

use std::fmt::Write as _;

use curvelax_ensemble::{Spec, Study};
use curvelax_flow::crystal::Energy;
use serde::Deserialize;
use serde_json::{Value, json};

/// Maximum members of a page: more do not show.
const MAX_MEMBERS: u64 = 1024;
/// Maximum nodes of all members together, for the memory of a phone.
const MAX_NODES: u64 = 1 << 18;
/// Members of the command that does the same, larger.
const LARGER: u64 = 10_000;
/// What `--adaptive` on the page stands for: `--accurate` without the two coarser runs that estimate its error.
const ADAPTIVE: [(&str, &str); 5] =
    [("adaptive", "1e-3"), ("pull", "auto"), ("omega", "auto"), ("t-end", "auto"), ("stop-when-relaxed", "true")];

/// The steps of the slider of anisotropies.
const FINEST_EPS: f64 = 1e-3;

/// The largest EPS of the slider for so many waves: the next one is refused, since the equation would be ill-posed.
pub fn strongest(waves: u32) -> f64 {
    let allowed = |eps: &f64| format!("cos:{waves},{eps:.3}").parse::<Energy>().is_ok();
    (0..1000).map(|i| f64::from(i) * FINEST_EPS).take_while(allowed).last().unwrap_or_default()
}

/// The settings of the page. Text is checked by the spec.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    shape: String,
    flow: String,
    /// The surface energy of a crystal, if it is not the same in all directions.
    #[serde(default)]
    energy: Option<String>,
    amplitude: f64,
    n: u64,
    curves: u64,
    seed: u64,
    adaptive: bool,
    /// `f32` or `f64`.
    #[serde(default)]
    precision: Option<String>,
}

impl Settings {
    /// The keys and values of the spec; values are TOML.
    fn keys(&self) -> Vec<(&'static str, String)> {
        let text = |value: &str| Value::from(value).to_string();
        let Settings { shape, flow, energy, amplitude, n, curves, seed, adaptive, precision } = self;
        let mut keys = vec![("shape", text(shape)), ("flow", text(flow))];
        keys.extend(energy.iter().map(|energy| ("energy", text(energy))));
        keys.extend([
            ("amplitude", format!("{amplitude:?}")),
            ("points", n.to_string()),
            ("curves", curves.to_string()),
            ("seed", seed.to_string()),
        ]);
        if *adaptive {
            let word = |value: &str| if value == "auto" { text(value) } else { value.to_string() };
            keys.extend(ADAPTIVE.map(|(key, value)| (key, word(value))));
        }
        keys.extend(precision.iter().map(|precision| ("precision", text(precision))));
        keys
    }

    /// The study that the program would make of it.
    pub fn study(&self) -> Result<Study, String> {
        let toml = self.keys().iter().fold(String::new(), |mut all, (key, value)| {
            let _ = writeln!(all, "{key} = {value}");
            all
        });
        let study = Study::new(Spec::from_toml(&toml)?).map_err(|error| error.to_string())?;
        let (members, n) = (study.member_count(), study.points() as u64);
        if members > MAX_MEMBERS || members.saturating_mul(n) > MAX_NODES {
            return Err(format!(
                "{members} members of {n} nodes: this page shows at most {MAX_MEMBERS}, and {MAX_NODES} nodes \
                 together; use fewer, or the program"
            ));
        }
        Ok(study)
    }

    /// Checks the settings, and says what the page shows about them.
    pub fn check(&self) -> Result<Value, String> {
        let study = self.study()?;
        Ok(json!({
            "members": study.member_count(),
            "command": self.command(self.curves.max(LARGER)),
            "warnings": study.note().into_iter().chain(study.warnings()).collect::<Vec<_>>(),
        }))
    }

    /// The command that does the same with so many `curves`.
    fn command(&self, curves: u64) -> String {
        let mut line = "curvelax run".to_string();
        for (key, value) in (Settings { curves, ..self.clone() }).keys() {
            let value = value.trim_matches('"');
            let _ = match value {
                "true" => write!(line, " --{key}"),
                value if key == "adaptive" => write!(line, " --{key}={value}"),
                value if value.chars().all(|c| c.is_ascii_alphanumeric() || ":.,-_".contains(c)) => {
                    write!(line, " --{key} {value}")
                }
                value => write!(line, " --{key} '{value}'"),
            };
        }
        line + " --out curves"
    }
}
