//! The kernels of the reprojection. The scalar one is the specification; others must give the same bits.

mod scalar;

pub(crate) use scalar::direction_to_square;
pub use scalar::project_corners;
