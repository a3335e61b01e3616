//! The library's entry point: runs a study and passes on what its members leave.

use crate::{
    ensemble::{Sink, Study},
    error::Result,
    placement::{Platform, choose_all},
    simulate::simulate,
};

/// Relaxes the members of a study on the device given by its spec, by default the first hardware GPU that can do it and
/// else the CPU, and passes each to `sink` in member order. A `Vec` of [`Ended`](crate::ensemble::Ended) is a sink that
/// collects them.
///
/// Returns where they were computed. The first [`PORTRAITS`](crate::ensemble::study::PORTRAITS) members come with their
/// nodes.
///
/// ```
/// use curvelax::{ensemble::{Spec, Study}, relax};
///
/// let study = Study::new(Spec { curves: 3, t_end: Some(0.05.into()), ..Spec::default() })?;
/// let mut members = Vec::new();
/// relax(&study, &mut members)?;
/// assert!(members.iter().all(|member| member.outcome.end.length < member.outcome.start.length));
/// # Ok::<(), curvelax::Error>(())
/// ```
///
/// # Errors
/// [`Error::Request`](crate::Error::Request) if this machine cannot do what the spec asks for,
/// [`Error::Device`](crate::Error::Device) if a requested GPU fails, and the errors of the sink.
pub fn relax(study: &Study, sink: &mut dyn Sink) -> Result<Platform> {
    let mut there: Option<Platform> = None;
    let choices = choose_all(study)?;
    for (range, choice) in study.cohorts().into_iter().zip(choices) {
        let cohort = &study.cells()[range];
        // A study does not change device midway.
        let choice = match &there {
            Some(platform) => choice.after(platform),
            None => choice,
        };
        let (mut backend, platform) = choice.open_for(cohort)?;
        simulate(cohort, choice.precision(), backend.as_mut(), study.portraits(cohort.len()), sink)?;
        there.get_or_insert(platform);
    }
    there.ok_or_else(|| crate::Error::Failed("a study has no cell".into()))
}
