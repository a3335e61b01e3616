//! curvelax for a page in a browser: what the page asks, as JSON, and the answers.
//!
//! The page has one instance of this module for itself, which checks settings and draws charts, and one in each worker,
//! which runs the members on the CPU, or with buffers and dispatches that the worker carries to WebGPU.

mod charts;
mod exports;
mod gpu;
mod run;
mod settings;

use serde::Deserialize;
use serde_json::{Value, json};

use charts::Charts;
use run::{Place, Run};
use settings::Settings;

/// What the page asks.
#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
enum Request {
    /// Whether these settings can be run, and the command that does the same.
    Check { settings: Settings },
    /// The strongest anisotropy of so many waves.
    Strongest { waves: u32 },
    /// Starts a run.
    Start { settings: Settings, place: Place },
    /// Takes a turn of the run.
    Turn,
    /// Where the members are now.
    Frame,
    /// Draws the charts.
    Charts(Charts),
}

/// The state of an instance.
#[derive(Default)]
struct Instance {
    run: Option<Run>,
}

impl Instance {
    /// Answers a request: an object that has `error`, if something is wrong.
    fn answer(&mut self, request: &[u8]) -> Value {
        let asked = serde_json::from_slice(request).map_err(|e| format!("the page asks in a wrong way: {e}"));
        asked.and_then(|request| self.answer_to(request)).unwrap_or_else(|error| json!({ "error": error }))
    }

    fn answer_to(&mut self, request: Request) -> Result<Value, String> {
        let none = "no run has been started";
        match request {
            Request::Check { settings } => settings.check(),
            Request::Strongest { waves } => Ok(json!({ "eps": settings::strongest(waves) })),
            Request::Start { settings, place } => {
                let (run, answer) = Run::start(&settings, place)?;
                self.run = Some(run);
                Ok(answer)
            }
            Request::Turn => self.run.as_mut().ok_or(none)?.turn(),
            Request::Frame => Ok(self.run.as_mut().ok_or(none)?.frame()?),
            Request::Charts(charts) => charts.draw(),
        }
    }
}
