#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod codec;
mod elements;
mod grid;
mod index;
mod layers;
mod merge;
mod outline;
mod read;
mod record;
mod samples;
mod silhouette;
mod validity;

pub use codec::{CodecError, FORMAT_VERSION, from_bytes, to_bytes};
pub use elements::{Elements, LANES, Sides};
pub use glam;
pub use grid::BallGrid;
pub use index::{Found, Index};
pub use layers::depth_layers;
pub use merge::{DepthRange, MergeSettings};
pub use outline::Outline;
pub use record::{Record, RecordSettings};
pub use samples::{MAX_RESOLUTION, Samples};
pub use validity::Validity;
