//! Outlines as a run saves them: what was read, from which the same run resumes without the files.

use std::{borrow::Cow, collections::BTreeMap, path::PathBuf, sync::Arc};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::Labelled;
use crate::Outline;

/// The parts of a [`Labelled`] outline.
#[derive(Debug, Serialize, Deserialize)]
pub struct SavedOutline<'a> {
    label: String,
    properties: BTreeMap<String, String>,
    file: PathBuf,
    /// Of the file, see [`Outline::digest`].
    digest: u32,
    simple: bool,
    warnings: Vec<String>,
    vertices: Cow<'a, [DVec2]>,
}

impl SavedOutline<'_> {
    /// The parts of `one`.
    pub fn new(one: &Labelled) -> SavedOutline<'_> {
        let Labelled { label, properties, file, outline } = one;
        SavedOutline {
            label: label.clone(),
            properties: properties.clone(),
            file: file.clone(),
            digest: outline.digest(),
            simple: outline.is_simple(),
            warnings: outline.warnings().to_vec(),
            vertices: outline.vertices().into(),
        }
    }

    /// The outline with these parts; `None` if there is none.
    pub fn restored(self) -> Option<Labelled> {
        let SavedOutline { label, properties, file, digest, simple, warnings, vertices } = self;
        let outline = Outline::of_parts(vertices.into_owned(), simple, warnings, digest)?;
        Some(Labelled { label, properties, file, outline: Arc::new(outline) })
    }
}
