//! The maps over slices, as structures of arrays: the loops hold no branch and no call, so that the compiler makes them
//! as wide as the target allows. Each element has the bits of the scalar form.
//!
//! Four functions that differ in what they call: a generic one would hide which slices go in and which come out.

use crate::{disk, hemisphere};

/// Maps each square point (`u`, `v`) to the direction (`x`, `y`, `z`), as
/// [`square_to_cosine_hemisphere`](crate::square_to_cosine_hemisphere) does.
///
/// # Panics
/// When the slices differ in length.
pub fn square_to_cosine_hemisphere_slice(u: &[f32], v: &[f32], x: &mut [f32], y: &mut [f32], z: &mut [f32]) {
    let n = equal([u.len(), v.len(), x.len(), y.len(), z.len()]);
    for i in 0..n {
        [x[i], y[i], z[i]] = hemisphere::to_cosine(u[i], v[i]);
    }
}

/// Maps each direction (`x`, `y`, z >= 0) to the square point (`u`, `v`), as
/// [`cosine_hemisphere_to_square`](crate::cosine_hemisphere_to_square) does; z is not needed.
///
/// # Panics
/// When the slices differ in length.
pub fn cosine_hemisphere_to_square_slice(x: &[f32], y: &[f32], u: &mut [f32], v: &mut [f32]) {
    let n = equal([x.len(), y.len(), u.len(), v.len()]);
    for i in 0..n {
        [u[i], v[i]] = disk::from_disk(x[i], y[i]);
    }
}

/// Maps each square point (`u`, `v`) to the direction (`x`, `y`, `z`), as
/// [`square_to_uniform_hemisphere`](crate::square_to_uniform_hemisphere) does.
///
/// # Panics
/// When the slices differ in length.
pub fn square_to_uniform_hemisphere_slice(u: &[f32], v: &[f32], x: &mut [f32], y: &mut [f32], z: &mut [f32]) {
    let n = equal([u.len(), v.len(), x.len(), y.len(), z.len()]);
    for i in 0..n {
        [x[i], y[i], z[i]] = hemisphere::to_uniform(u[i], v[i]);
    }
}

/// Maps each direction (`x`, `y`, `z`) to the square point (`u`, `v`), as
/// [`uniform_hemisphere_to_square`](crate::uniform_hemisphere_to_square) does.
///
/// # Panics
/// When the slices differ in length.
pub fn uniform_hemisphere_to_square_slice(x: &[f32], y: &[f32], z: &[f32], u: &mut [f32], v: &mut [f32]) {
    let n = equal([x.len(), y.len(), z.len(), u.len(), v.len()]);
    for i in 0..n {
        [u[i], v[i]] = hemisphere::from_uniform(x[i], y[i], z[i]);
    }
}

/// The one length of all; known to the compiler, it removes the bounds checks of the loop.
#[inline(always)]
fn equal<const N: usize>(lengths: [usize; N]) -> usize {
    assert!(lengths.iter().all(|n| *n == lengths[0]), "slices of lengths {lengths:?}");
    lengths[0]
}
