//! What linear theory says of a curve before it moves: its rates, the time that it needs, and what suits both.

pub(crate) mod horizon;
pub(crate) mod rates;
pub(crate) mod times;
pub(crate) mod vanishing;
