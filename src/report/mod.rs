//! Reports: error against run time of a scene, and numerical stability over stiff and extreme cases.
//!
//! In: a checked scene with its shapes and a sweep of budgets; or names of families of cases. Out: figures, and pages
//! of HTML with self-contained plots. Both drive the engine that the daemon runs, without transport.

pub mod error;
pub mod plot;
pub mod rig;
pub mod sheet;
pub mod stability;
pub mod stats;
