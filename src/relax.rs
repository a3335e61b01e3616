//! The library's front door: a study in, what its members leave out.

use crate::{
    ensemble::{Sink, Study},
    error::Result,
    placement::{Platform, choose_all},
    simulate::simulate,
};

/// Relaxes the members of a study where its spec says, by default on the first hardware GPU that can do it and else on the
/// CPU, and hands each to `sink` in member order. A `Vec` of [`Ended`](crate::ensemble::Ended) is a sink that collects them.
///
/// Returns where that was. The first [`PORTRAITS`](crate::ensemble::study::PORTRAITS) members come with their nodes.
///
/// ```
/// use curvelax::{ensemble::{Spec, Study}, relax};
///
/// let study = Study::new(Spec { curves: 3, t_end: 0.05, ..Spec::default() })?;
/// let mut members = Vec::new();
/// relax(&study, &mut members)?;
/// assert!(members.iter().all(|member| member.outcome.end.length < member.outcome.start.length));
/// # Ok::<(), curvelax::Error>(())
/// ```
///
/// # Errors
/// [`Error::Request`](crate::Error::Request) where this machine cannot do what the spec asks for,
/// [`Error::Device`](crate::Error::Device) where a GPU that it asks for fails, and those of the sink.
pub fn relax(study: &Study, sink: &mut dyn Sink) -> Result<Platform> {
    let mut there: Option<Platform> = None;
    let choices = choose_all(study)?;
    for (range, choice) in study.cohorts().into_iter().zip(choices) {
        let cohort = &study.cells()[range];
        // A study does not move in its midst.
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
