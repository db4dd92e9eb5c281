//! The box around three slabs that lie across each other: what `clipped` leaves of a solid, turned anyhow.
//!
//! One slab |n.v - c| <= h is endless, and so is its box unless n is an axis; three with independent normals are a
//! parallelepiped
//!
//! ```text
//! v = sum (c_i + s_i h_i) d_i,   |s_i| <= 1,   d_i the dual basis of the n_i
//! ```
//!
//! of middle sum c_i d_i and half-widths sum h_i |d_i|.

use glam::{DMat3, DVec3};

use crate::{FreeForm, bounds::Extent};

/// The places where a quadric of one variable n.v is not negative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slab {
    /// Unit vector.
    normal: DVec3,
    middle: f64,
    half: f64,
}

/// A quadric whose other second derivatives are a smaller share of its own counts as a slab.
const FLATNESS: f64 = 1e-12;
/// Normals whose volume is smaller do not lie across each other clearly: rounding would decide about the box.
const VOLUME_MIN: f64 = 1e-3;
/// The box is widened by this share of its reach: for what FLATNESS forgives, over VOLUME_MIN.
const MARGIN: f64 = 1e-8;

impl Slab {
    /// Returns the slab that a form lies in where its function is `-depth` or more; `None` for any other form.
    pub(crate) fn of_form(form: &FreeForm, depth: f64) -> Option<Self> {
        // A swelling may reach beyond the base.
        if form.perturbations().iter().any(|p| p.factor > 0.0) {
            return None;
        }
        let (hessian, linear) = (form.base().hessian(), form.base().linear());
        let columns = [hessian.x_axis, hessian.y_axis, hessian.z_axis];
        let normal =
            columns.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?.try_normalize()?;
        // Q = k + b s - a s^2 with s = n.v.
        let a = -0.5 * normal.dot(hessian * normal);
        let rest =
            columns.into_iter().zip(normal.to_array()).map(|(column, n)| (column + 2.0 * a * n * normal).length());
        let b = normal.dot(linear);
        let across = (linear - b * normal).length();
        let height = form.base().coefficients[9] + depth + b * b / (4.0 * a);
        let is_slab = a > 0.0
            && rest.fold(0.0, f64::max) <= FLATNESS * a
            && across <= FLATNESS * (b.abs() + a * (height / a).sqrt());
        is_slab.then(|| Self {
            normal,
            middle: b / (2.0 * a) + normal.dot(form.origin()),
            half: (height.max(0.0) / a).sqrt(),
        })
    }
}

/// Returns the box around what lies in all of the slabs; `ALL` where no three of them lie clearly across each other.
pub(crate) fn extent(slabs: &[Slab]) -> Extent {
    let mut best = (VOLUME_MIN, Extent::ALL);
    for (i, a) in slabs.iter().enumerate() {
        for (j, b) in slabs.iter().enumerate().skip(i + 1) {
            for c in &slabs[j + 1..] {
                let across = DMat3::from_cols(a.normal, b.normal, c.normal).transpose();
                let volume = across.determinant().abs();
                if volume > best.0 {
                    best = (volume, parallelepiped(across, [*a, *b, *c]));
                }
            }
        }
    }
    best.1
}

fn parallelepiped(across: DMat3, slabs: [Slab; 3]) -> Extent {
    // The columns of the inverse are the dual basis.
    let dual = across.inverse();
    let [a, b, c] = slabs;
    let middle = dual * DVec3::new(a.middle, b.middle, c.middle);
    let widths = dual.x_axis.abs() * a.half + dual.y_axis.abs() * b.half + dual.z_axis.abs() * c.half;
    let widths = widths + MARGIN * widths.max_element() + f64::EPSILON / VOLUME_MIN * middle.abs().max_element();
    Extent { min: middle - widths, max: middle + widths }
}
