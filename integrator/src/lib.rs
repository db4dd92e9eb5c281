#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod metrics;

mod sampler;
mod settings;
mod statistics;

pub use sampler::{Rng, Sampler, hash, hash_pair};
pub use settings::{MAX_PIXELS, MAX_SIDE, MAX_SPP, Method, QUALITY_RANGE, Settings, SettingsError};
pub use statistics::{Phase, Progress, RayCounts, Statistics};
