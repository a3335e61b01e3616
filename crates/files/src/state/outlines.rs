//! `.curvelax.outlines`: the outlines of a run as they were read, from which it resumes wherever their files are.
//!
//! It is [sealed](super::envelope) like a checkpoint, written once before the first one, and removed after the last.

use std::sync::LazyLock;

use super::{
    checkpoint::Origin,
    envelope::{Fault, bytes, opened, sealed_body},
    fingerprint::fingerprint,
};
use crate::{folder::OutputFolder, names::OUTLINES};
use curvelax_base::error::Result;
use curvelax_curve::outlines::Labelled;
use curvelax_ensemble::Outlines;

/// The content of the file: the text of each shape, and its outlines.
type Content = Vec<(String, Vec<Labelled>)>;

/// The fingerprint of its layout.
static LAYOUT: LazyLock<u32> = LazyLock::new(fingerprint::<Content>);

/// Saves `outlines` in `folder`, if there are any.
pub fn save(folder: &OutputFolder, outlines: &Outlines) -> Result<()> {
    if outlines.is_empty() {
        return Ok(());
    }
    folder.keep_outlines(&sealed_body(*LAYOUT, OUTLINES, &outlines.saved())?)
}

/// The outlines that were saved in `folder` by the run with this origin; none if it has none.
///
/// # Errors
/// Why they are to be read from their files again.
pub fn find(folder: &OutputFolder, origin: &Origin) -> Result<Outlines, String> {
    if origin.outlines.is_empty() {
        return Ok(Outlines::default());
    }
    read(folder, origin).map_err(|(Fault::Foreign(what) | Fault::Damaged(what))| {
        format!("{OUTLINES}: {what}; the outlines are read from their files again")
    })
}

fn read(folder: &OutputFolder, origin: &Origin) -> Result<Outlines, Fault> {
    let bytes = bytes(folder.place(OUTLINES).at())?;
    let saved: Content = opened(*LAYOUT, &bytes)?;
    let outlines =
        Outlines::restored(saved).ok_or_else(|| Fault::Damaged("it holds points without an outline".into()))?;
    match origin.differs(&outlines) {
        None => Ok(outlines),
        Some(path) => Err(Fault::Damaged(format!("it does not hold the {} of this run", path.display()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::fingerprint::layout;

    #[test]
    fn the_layout_has_every_part_of_an_outline() {
        let layout = layout::<Content>().unwrap();
        for part in ["label: string", "properties: map", "file: string", "digest: u32", "simple: bool", "DVec2"] {
            assert!(layout.contains(part), "{part}: {layout}");
        }
    }
}
