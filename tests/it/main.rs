//! The tests that need nothing of their own process: one program, so that the library is linked once. A file is a
//! module, and `cargo test --release --test it MODULE::` runs its tests.

#[path = "../common/mod.rs"]
mod common;

mod animate;
mod bad_folders;
mod bad_input;
mod bench;
mod cli;
mod clock;
mod convergence;
mod coverage;
mod crystals;
mod distributions;
mod documents;
mod driven;
mod ensemble;
mod events;
mod explained;
mod extremes;
mod figures;
mod files;
mod finer;
mod folder;
mod form;
mod interrupted;
mod invariants;
mod modules_depend_downward;
mod outlines;
mod overlong_input;
mod papers;
mod plot;
mod polygons;
mod rates;
mod referee;
mod reference;
mod refine;
mod relaxation;
mod report;
mod rows;
mod scaling;
mod shaders;
mod shards;
mod starts;
mod statistics;
mod store;
mod study;
mod twins;
mod vectors;
mod vesicles;
mod vocabulary;
