//! The maps over slices, as structures of arrays.

use crate::{disk::from_disk, hemisphere};

/// Maps each (u, v) as [`crate::square_to_cosine_hemisphere`] does, bit for bit.
///
/// # Panics
/// When the slices differ in length.
pub fn square_to_cosine_hemisphere_slice(
    u: &[f32],
    v: &[f32],
    x: &mut [f32],
    y: &mut [f32],
    z: &mut [f32],
) {
    let n = u.len();
    assert!(
        v.len() == n && x.len() == n && y.len() == n && z.len() == n,
        "slices of equal length"
    );
    for i in 0..n {
        [x[i], y[i], z[i]] = hemisphere::to_cosine(u[i], v[i]);
    }
}

/// Maps each (x, y) as [`crate::cosine_hemisphere_to_square`] does, bit for bit.
///
/// # Panics
/// When the slices differ in length.
pub fn cosine_hemisphere_to_square_slice(x: &[f32], y: &[f32], u: &mut [f32], v: &mut [f32]) {
    let n = x.len();
    assert!(
        y.len() == n && u.len() == n && v.len() == n,
        "slices of equal length"
    );
    for i in 0..n {
        [u[i], v[i]] = from_disk(x[i], y[i]);
    }
}

/// Maps each (u, v) as [`crate::square_to_uniform_hemisphere`] does, bit for bit.
///
/// # Panics
/// When the slices differ in length.
pub fn square_to_uniform_hemisphere_slice(
    u: &[f32],
    v: &[f32],
    x: &mut [f32],
    y: &mut [f32],
    z: &mut [f32],
) {
    let n = u.len();
    assert!(
        v.len() == n && x.len() == n && y.len() == n && z.len() == n,
        "slices of equal length"
    );
    for i in 0..n {
        [x[i], y[i], z[i]] = hemisphere::to_uniform(u[i], v[i]);
    }
}

/// Maps each (x, y, z) as [`crate::uniform_hemisphere_to_square`] does, bit for bit.
///
/// # Panics
/// When the slices differ in length.
pub fn uniform_hemisphere_to_square_slice(
    x: &[f32],
    y: &[f32],
    z: &[f32],
    u: &mut [f32],
    v: &mut [f32],
) {
    let n = x.len();
    assert!(
        y.len() == n && z.len() == n && u.len() == n && v.len() == n,
        "slices of equal length"
    );
    for i in 0..n {
        [u[i], v[i]] = hemisphere::from_uniform(x[i], y[i], z[i]);
    }
}
