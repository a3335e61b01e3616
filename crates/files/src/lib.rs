//! A run's folder and its files: who may write there, how a file becomes durable, and what each one holds.
//!
//! Files grow under names ending in `.part` and get their final names together, when all of them are complete.

pub mod claim;
mod column;
pub mod columns;
pub mod disk;
mod fields;
pub mod folder;
mod foreign;
pub mod growing;
pub mod members;
pub mod names;
pub mod owner;
pub mod parquet;
pub mod part_file;
pub mod part_folder;
pub mod place;
pub mod portraits;
pub mod reader;
#[doc(hidden)]
pub mod samples;
pub mod spill;
pub mod state;
mod table_reader;
pub mod tables;
pub mod truth_tables;
pub mod zarr;

pub use column::{Column, TableRow};
pub use folder::OutputFolder;
pub use owner::{Existing, Owner};
pub use table_reader::TableReader;
