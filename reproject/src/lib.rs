#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod holes;
mod kernel;
mod masks;
mod tracer;
mod trail;
mod verify;
mod workspace;

pub use kernel::project_corners;
pub use masks::{Masks, Rows, polygon_rows, rectangle_rows};
pub use tracer::{Traced, Tracer};
pub use verify::Verdict;
pub use workspace::{AreaWeights, Coverage, Settings, Shares, Trails, Workspace};
