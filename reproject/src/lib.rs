#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

mod clip;
mod gather;
mod holes;
mod horizon;
mod kernel;
mod masks;
mod parts;
mod project;
mod raster;
mod samples;
mod tracer;
mod verify;
mod workspace;

pub use gather::gather;
pub use glam;
pub use kernel::{Kernel, project_corners};
pub use masks::{Masks, Rows};
pub use parts::Parts;
pub use raster::{polygon_rows, rectangle_rows};
pub use tracer::{Traced, Tracer};
pub use verify::Verdict;
pub use workspace::{AreaWeights, Coverage, Settings, Shares, Trails, Workspace};
