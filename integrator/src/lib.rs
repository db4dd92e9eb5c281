#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod metrics;

mod allocation;
mod asked_error;
mod caustic_need;
mod cells;
mod delta_ways;
mod explain;
mod film;
mod follower;
mod four_terms;
mod gather;
mod irradiance_cache;
mod lattice;
mod light_lessons;
mod path;
mod photons;
mod plan;
mod record_points;
mod render;
mod rungs;
mod sampler;
mod secondary;
mod settings;
mod shadows;
mod sky;
mod statistics;
mod study;
mod surface_points;
mod terms;
mod walk;

pub use asked_error::{ERROR_RANGE, ErrorEstimate, PixelEstimate, estimate_pixel, render_to_error};
pub use cells::Glint;
pub use explain::{Explanation, IrradianceFacts, PointExplanation, RecordFacts, Step, explain};
pub use film::{Film, FirstHit, Terms};
pub use path::{MAX_PATH_VERTICES, PathSample, PathTracer};
pub use photons::{FluxBalance, Irradiance, PhotonCounts, PhotonMaps, PhotonSettings, PhotonSource};
pub use record_points::{RecordKind, RecordPoint};
pub use render::{Rendering, render, render_with};
pub use reproject::{Parts, Shares, Trails, Verdict};
pub use rungs::Rungs;
pub use sampler::{Rng, Sampler, hash, hash_pair};
pub use secondary::{Known, NoSecondary, Secondary};
pub use settings::{MAX_PIXELS, MAX_SIDE, MAX_SPP, Method, QUALITY_RANGE, SecondaryKind, Settings, SettingsError};
pub use statistics::{Memory, Phase, Progress, RayCounts, Statistics};
pub use study::{Study, StudyError};
