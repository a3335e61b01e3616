//! The `curvelax` program.

fn main() {}
