#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod bernstein;
mod bounds;
mod error;
mod form;
mod interval;
mod nested;
mod normal;
mod quadratic;
mod quadric;
mod query;
mod ray;
mod sextic;
mod shapes;
mod solid;
mod texture;
mod trace;

pub use bounds::Bounds;
pub use error::FormError;
pub use form::{FreeForm, Perturbation};
pub use interval::{Interval, difference};
pub use quadric::Quadric;
pub use ray::{Crossing, Ray};
pub use solid::{DEPTH_LIMIT, Psi, Solid, Union};
