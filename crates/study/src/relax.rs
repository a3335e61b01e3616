//! The library's entry point: runs a study and passes on what its members leave.

use crate::placement::{OpeningWatch, Platform, choose_all};
use curvelax_base::error::Result;
use curvelax_ensemble::{LevelSink, LevelTimes, Sink, Study, simulate::simulate};

/// Relaxes the members of a study on the device given by its spec, by default the first hardware GPU that can do it and
/// else the CPU, and passes each to `sink` in member order. A `Vec` of [`Ended`](curvelax_ensemble::Ended) is a sink
/// that collects them.
///
/// Returns where they were computed. The first [`PORTRAITS`](curvelax_ensemble::study::PORTRAITS) members come with
/// their nodes.
///
/// ```
/// use curvelax_ensemble::{Spec, Study};
/// use curvelax_study::relax;
///
/// let study = Study::new(Spec { curves: 3, t_end: Some(0.05.into()), ..Spec::default() })?;
/// let mut members = Vec::new();
/// relax(&study, &mut members)?;
/// assert!(members.iter().all(|member| member.outcome.end.length < member.outcome.start.length));
/// # Ok::<(), curvelax_base::Error>(())
/// ```
///
/// # Errors
/// [`Error::Request`](curvelax_base::error::Error::Request) if this machine cannot do what the spec asks for,
/// [`Error::Device`](curvelax_base::error::Error::Device) if a requested GPU fails, and the errors of the sink.
pub fn relax(study: &Study, sink: &mut dyn Sink) -> Result<Platform> {
    let (stages, choices) = (study.stages(), choose_all(study)?);
    let (own, watch) = (study.own_stage(), OpeningWatch::default());
    // Where it is computed depends on whether this device can be opened.
    let (first, platform) = choices[own].open_for(&study.cells()[stages[own].range.clone()], &watch)?;
    let (mut first, mut levels) = (Some(first), LevelTimes::default());
    for (i, (stage, choice)) in stages.iter().zip(choices).enumerate() {
        let cells = study.cells_of(stage, &levels)?;
        // No member needs these nodes.
        if cells.is_empty() {
            continue;
        }
        let (mut backend, precision) = match first.take_if(|_| i == own) {
            Some(first) => (first, platform.precision),
            None => {
                // A study does not change device midway.
                let choice = choice.after(&platform);
                (choice.open_for(&cells, &watch)?.0, choice.precision)
            }
        };
        let mut sink = LevelSink { level: stage.level, precision, cells: &cells, levels: &mut levels, sink };
        simulate(&cells, precision, backend.as_mut(), study.portraits(stage), &mut sink)?;
    }
    Ok(platform)
}
