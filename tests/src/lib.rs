//! Helpers that the tests of facts across crates share: scenes built in a line, small pictures of them, closed forms
//! and the statistics by which one is compared with the other.
#![forbid(unsafe_code)]

mod build;
mod closed_forms;
mod estimates;
pub mod graded;
mod measure;
mod shapes;
mod study;

pub use build::{Builder, black, glass, glass_before, gloss, lambert, lamp, mirror};
pub use closed_forms::{polygon_irradiance, sphere_irradiance};
pub use estimates::Exceeded;
pub use measure::{Effort, METHODS, Measured, Pictures, Term, film, measure, print};
pub use shapes::{cuboid, icosphere};
pub use study::{Blocks, STUDY_SIZE, Study, data_folder, is_full};
