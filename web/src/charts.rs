//! The charts: those of the program's report, with a curve for the CPU and one for the GPU.

use curvelax_draw::{
    charts::{CellKey, ChartText, Decay, DecayCurve, DecayLaw, Survival, SurvivalCurve, Theory},
    medium::Medium,
};
use curvelax_ensemble::{Spec, outcome::linear_rate};
use curvelax_statistics::{HALF_INTERVAL, Observation, Sample, Step};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::settings::Settings;

/// What the charts show.
#[derive(Deserialize)]
pub struct Charts {
    settings: Settings,
    runs: Vec<Shown>,
}

/// A run, as far as it has come.
#[derive(Deserialize)]
struct Shown {
    label: String,
    /// The times of the grid that all members have reached, and their mean excess.
    t: Vec<f64>,
    mean: Vec<f64>,
    /// For each member the time at which it relaxed, or until which it has not.
    times: Vec<(f64, bool)>,
    /// Mean area at the start.
    area: f64,
}

impl Charts {
    /// Returns both charts as SVG.
    pub fn draw(self) -> Result<Value, String> {
        let spec = self.settings.study()?.spec().clone();
        let curves: Result<Vec<SurvivalCurve>, String> = self.runs.iter().map(Shown::survival).collect();
        let text = self.text("Members not yet relaxed");
        let survival = Survival { text, curves: curves?, ..Survival::default() };
        let curves: Vec<DecayCurve> = self.runs.iter().map(Shown::decay).collect();
        let theory = self.runs.first().zip(curves.first()).and_then(|(run, curve)| slope(&spec, run.area, curve));
        let text = self.text("Mean excess of all members");
        let decay = Decay { text, theory: theory.into_iter().collect(), curves, ..Decay::default() };
        Ok(json!({ "survival": survival.draw(Medium::Screen), "decay": decay.draw(Medium::Screen) }))
    }

    /// A heading, and the runs of the legend.
    fn text(&self, title: &str) -> ChartText {
        let labels = self.runs.iter().map(|run| run.label.clone()).collect();
        let key = CellKey { labels, ..CellKey::default() };
        ChartText { title: title.into(), quantity: "t".into(), key, ..ChartText::default() }
    }
}

impl Shown {
    fn survival(&self) -> Result<SurvivalCurve, String> {
        let seen = self.times.iter().map(|(t, relaxed)| Observation::new(relaxed.then_some(*t), *t));
        let sample = Sample::new(seen).map_err(|error| error.to_string())?;
        let mut curve = SurvivalCurve::default();
        for Step { time, survival, variance, .. } in sample.steps() {
            let bound = |sign: f64| (survival + sign * HALF_INTERVAL * variance.sqrt()).clamp(0.0, 1.0);
            curve.add_step(time, survival, (bound(-1.0), bound(1.0)));
        }
        let unrelaxed = sample.observations().filter(|seen| !seen.happened);
        unrelaxed.for_each(|seen| curve.add_censored(seen.time));
        Ok(curve)
    }

    fn decay(&self) -> DecayCurve {
        DecayCurve { t: self.t.clone(), mean: self.mean.clone(), ..DecayCurve::default() }
    }
}

/// The slope of linear theory, through the point where the mean has fallen to a tenth, as in the program's report.
fn slope(spec: &Spec, area: f64, curve: &DecayCurve) -> Option<Theory> {
    let values = spec.typical();
    let first = curve.mean.first()?;
    let tenth = curve.mean.iter().position(|mean| *mean <= 0.1 * first)?;
    let (t, mean) = (curve.t[tenth], curve.mean[tenth]);
    let rate = linear_rate::rate_at(spec, area, t)?;
    let law = match spec.growth(&values.flow, &values.forcing, area) {
        Some(time) => DecayLaw::Algebraic { start: mean * (1.0 + t / time).powf(rate), time, power: rate },
        None => DecayLaw::Exponential { start: mean * (rate * t).exp(), rate },
    };
    Some(Theory { label: "slope of linear theory".into(), law })
}
