//! The irradiance cache: what reprojected points become, and with gathers in their place the rival of reprojection as
//! it is used today.
//!
//! A record keeps the irradiance of one point, its gradients by turning and by moving, and the matrix of its second
//! derivatives, the Hessian. The gradients carry it to the points around; the Hessian says how wrong that becomes, and
//! so how far along each of two axes the record may reach. Other points take the weighted mean of all records that
//! reach them.
//!
//! | file | what |
//! |---|---|
//! | `hessian` | symmetric matrices, and radii for an allowed error |
//! | `edges` | derivatives of the light that texels bring, from the edges between them |
//! | `record` | where a record reaches, and what it says there |
//! | `index` | the records that may reach a point |
//! | `recorder` | records of the points of a picture |
//! | `fill` | which points look for themselves |
//!
//! # Source
//!
//! Ward, Rubinstein and Clear 1988, *A ray tracing solution for diffuse interreflection*; Ward and Heckbert 1992,
//! *Irradiance gradients*; Krivanek, Gautron, Bouatouch and Pattanaik 2005, *Improved radiance gradient computation*;
//! Schwarzhaupt, Jensen and Jarosz 2012, *Practical Hessian-based error control for irradiance caching*. Each file says
//! where it departs from them.

mod edges;
mod fill;
mod hessian;
mod index;
mod record;
mod recorder;

pub(crate) use fill::fill;
pub(crate) use index::Index;
pub(crate) use record::{Record, is_lit_by_few};
pub(crate) use recorder::Recorder;
