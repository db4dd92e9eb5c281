#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod along;
mod bernstein;
mod blend;
mod bounds;
mod boxes;
mod buffer;
mod cells;
mod error;
mod evaluation;
mod form;
mod interval;
mod mesh;
mod nested;
mod normal;
mod plan;
mod polish;
mod psi;
mod quadratic;
mod quadric;
mod query;
mod range;
mod ray;
mod sextic;
mod shapes;
mod slabs;
mod solid;
mod text;
mod texture;
mod trace;
mod tree;

pub use bounds::Bounds;
pub use error::FormError;
pub use form::{FreeForm, Perturbation};
pub use glam;
pub use interval::{Interval, difference};
pub use mesh::{MeshError, SurfaceMesh};
pub use psi::Psi;
pub use quadric::Quadric;
pub use ray::{Crossing, Ray};
pub use solid::{DEPTH_LIMIT, Solid};
pub use text::TextError;
pub use tree::Operation;
