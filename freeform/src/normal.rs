//! Outward normals, also where the gradient vanishes.

use glam::DVec3;

use crate::{
    Bounds, Solid,
    psi::{LocalLinear, Valued},
    tree::{self, Place},
};

/// A gradient below this share of the terms that it is summed from is rounding.
const GRADIENT_ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Step of the differences taken where the gradient vanishes, as a share of the solid's size: a cubic term changes by
/// 1e-9 of its size, well above rounding.
const STEP: f64 = 1e-3;
/// A difference of values below this share of them is rounding.
const DIFFERENCE_ROUNDING: f64 = 64.0 * f64::EPSILON;

impl Solid {
    /// Returns the outward unit normal at a point of the surface, for a ray that came along `direction` (of any
    /// length).
    ///
    /// It is minus the gradient. Where the gradient vanishes, in order: minus the difference of the function over a
    /// thousandth of the solid's size along each axis (that finds the side of a triple root or a cusp), minus
    /// `direction` (at the apex of a cone no side is better than another), and +z where that is zero too. It is never
    /// NaN.
    pub fn normal(&self, p: DVec3, direction: DVec3) -> DVec3 {
        self.normal_of(Place::default(), 1.0, p, direction)
    }

    /// Returns value and gradient at a point of the part of the solid that a ray crossed there
    /// ([`Crossing::part`](crate::Crossing)): the first-order behaviour of the whole, at a cost that does not grow with
    /// the number of parts.
    ///
    /// # Panics
    /// If no crossing of this solid has that part.
    pub fn first_order(&self, part: u32, p: DVec3) -> (f64, DVec3) {
        let unit = &self.plan.units[part as usize];
        let local = self.local_linear(p, unit.place);
        let LocalLinear { value, gradient, .. } = if unit.flipped { local.complement() } else { local };
        (value, gradient)
    }

    /// Returns the outward unit normal as [`Solid::normal`] does, by the part that a ray crossed at `p` alone.
    ///
    /// # Panics
    /// If no crossing of this solid has that part.
    pub fn normal_at(&self, part: u32, p: DVec3, direction: DVec3) -> DVec3 {
        let unit = &self.plan.units[part as usize];
        self.normal_of(unit.place, if unit.flipped { -1.0 } else { 1.0 }, p, direction)
    }

    /// The normal of a part that is taken away if `turn` is -1.
    fn normal_of(&self, place: Place, turn: f64, p: DVec3, direction: DVec3) -> DVec3 {
        self.gradient_normal(place, p)
            .or_else(|| self.difference_normal(place, p))
            .map(|normal| turn * normal)
            .or_else(|| unit(-direction))
            .unwrap_or(DVec3::Z)
    }

    fn gradient_normal(&self, place: Place, p: DVec3) -> Option<DVec3> {
        let LocalLinear { gradient, weight, .. } = self.local_linear(p, place);
        let rounding = GRADIENT_ROUNDING * weight;
        if gradient.abs().max_element() > rounding { unit(-gradient) } else { None }
    }

    fn difference_normal(&self, place: Place, p: DVec3) -> Option<DVec3> {
        let home = self.forms[place.form].origin();
        let size = match self.bounds() {
            Bounds::Finite { min, max } => (max - min).max_element(),
            Bounds::Unbounded => (p - home).length(),
        };
        let step = STEP * if size > 0.0 { size } else { 1.0 };
        let value = |p| tree::evaluate(&self.tokens, &mut place.clone(), &mut |form| self.forms[form].value(p));
        let mut largest = 0.0_f64;
        let difference = DVec3::AXES.map(|axis| {
            let (ahead, behind) = (value(p + step * axis), value(p - step * axis));
            largest = largest.max(ahead.abs()).max(behind.abs());
            ahead - behind
        });
        let difference = DVec3::from_array(difference);
        if difference.abs().max_element() > DIFFERENCE_ROUNDING * largest { unit(-difference) } else { None }
    }
}

/// Returns the unit vector along `v`, whatever its size; `None` for zero and what is not finite.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest > 0.0 && v.is_finite() { (v / largest).try_normalize() } else { None }
}
