//! Free forms (eqs. 2 and 3 of the paper): a base quadric, swollen and dented by cubed quadrics.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::{Bounds, FormError, Quadric, bounds::Extent, boxes::Boxes, psi::LocalLinear, quadric::inverse};

/// A swelling (positive factor) or a dent (negative factor) where its quadric is positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Perturbation {
    /// Q: the perturbation acts where it is positive.
    pub quadric: Quadric,
    /// The form-factor f. Zero changes nothing.
    pub factor: f64,
}

/// A base quadric with perturbations:
///
/// ```text
/// F'(p) = F(p) + sum_i f_i max(0, Q_i(p))^3,   inside where F'(p) >= 0
/// ```
///
/// Twice continuously differentiable everywhere. Coefficients are relative to `origin`, so that a form far from the
/// world's origin keeps its digits: move a form by its origin, not by its coefficients.
///
/// # Source
/// Equations 1 to 3 of the paper.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "Described", into = "Described")]
pub struct FreeForm {
    origin: DVec3,
    base: Quadric,
    perturbations: Vec<Perturbation>,
    /// Derived: box of the inside, relative to the origin.
    extent: Extent,
    /// Derived: where each perturbation acts, for forms of more than `LISTED`.
    supports: Option<Box<Boxes>>,
}

/// So many perturbations are gone through one by one; more have a tree of boxes.
const LISTED: usize = 8;

/// The form as files hold it, without what follows from it.
#[derive(Serialize, Deserialize)]
#[serde(rename = "FreeForm", deny_unknown_fields)]
struct Described {
    #[serde(default)]
    origin: DVec3,
    base: Quadric,
    #[serde(default)]
    perturbations: Vec<Perturbation>,
}

impl FreeForm {
    /// Returns the form of a base and its perturbations, with its origin at the world's.
    ///
    /// # Errors
    /// A number is not finite, or a quadric is zero everywhere.
    pub fn new(base: Quadric, perturbations: Vec<Perturbation>) -> Result<Self, FormError> {
        Self::with_origin(DVec3::ZERO, base, perturbations)
    }

    /// Returns the form whose coefficients are relative to `origin`.
    ///
    /// # Errors
    /// A number is not finite, or a quadric is zero everywhere. A base of zero would make all space outside the
    /// perturbations solid.
    pub fn with_origin(origin: DVec3, base: Quadric, perturbations: Vec<Perturbation>) -> Result<Self, FormError> {
        if !origin.is_finite() {
            return Err(FormError::OutOfRange("the origin"));
        }
        base.checked()?;
        for (index, perturbation) in perturbations.iter().enumerate() {
            perturbation.quadric.checked()?;
            if !perturbation.factor.is_finite() {
                return Err(FormError::FactorNotFinite { index });
            }
        }
        let extent = Extent::of_form(&base, &perturbations, 0.0);
        let support = |p: &Perturbation| if p.factor == 0.0 { Extent::EMPTY } else { Extent::of_quadric(&p.quadric) };
        let supports =
            (perturbations.len() > LISTED).then(|| Box::new(Boxes::new(perturbations.iter().map(support).collect())));
        Ok(Self { origin, base, perturbations, extent, supports })
    }

    /// Returns the same body with its function multiplied by `weight`, which matters to blends alone.
    ///
    /// # Errors
    /// The weight is not positive, or numbers overflow.
    pub fn weighted(&self, weight: f64) -> Result<Self, FormError> {
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(FormError::OutOfRange("a weight"));
        }
        let base = Quadric::new(self.base.coefficients.map(|c| c * weight))?;
        let weighted = |&Perturbation { quadric, factor }: &_| Perturbation { quadric, factor: factor * weight };
        Self::with_origin(self.origin, base, self.perturbations.iter().map(weighted).collect())
    }

    /// Returns the point that the coefficients are relative to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Returns the base quadric F, relative to the origin.
    pub fn base(&self) -> &Quadric {
        &self.base
    }

    /// Returns the perturbations, relative to the origin.
    pub fn perturbations(&self) -> &[Perturbation] {
        &self.perturbations
    }

    /// Returns F'(p): not negative inside.
    pub fn value(&self, p: DVec3) -> f64 {
        let p = p - self.origin;
        let mut sum = 0.0;
        self.acting_at(p, |Perturbation { factor, .. }, q| sum += factor * (q * q * q));
        self.base.value(p) + sum
    }

    /// Returns the gradient of F' at `p`: grad F + sum 3 f Q^2 grad Q over the positive Q. It points inwards on the
    /// surface.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let p = p - self.origin;
        let mut sum = DVec3::ZERO;
        self.acting_at(p, |Perturbation { quadric, factor }, q| sum += (3.0 * factor * (q * q)) * quadric.gradient(p));
        self.base.gradient(p) + sum
    }

    /// Returns value and gradient at `p` with the size of the terms that the gradient is summed from.
    pub(crate) fn local_linear(&self, p: DVec3) -> LocalLinear {
        let p = p - self.origin;
        let (mut value, mut gradient) = (0.0, DVec3::ZERO);
        let mut weight = self.base.gradient_weight(p).max_element();
        self.acting_at(p, |Perturbation { quadric, factor }, q| {
            value += factor * (q * q * q);
            gradient += (3.0 * factor * (q * q)) * quadric.gradient(p);
            weight += 3.0 * factor.abs() * (q * q) * quadric.gradient_weight(p).max_element();
        });
        LocalLinear { value: self.base.value(p) + value, gradient: self.base.gradient(p) + gradient, weight }
    }

    /// Shows the perturbations that act at `p`, relative to the origin, with their Q.
    fn acting_at(&self, p: DVec3, mut visit: impl FnMut(&Perturbation, f64)) {
        let mut test = |perturbation: &Perturbation| {
            let q = perturbation.quadric.value(p);
            if q > 0.0 {
                visit(perturbation, q);
            }
        };
        match &self.supports {
            None => self.perturbations.iter().for_each(test),
            Some(supports) => supports.around(p, |index| test(&self.perturbations[index as usize])),
        }
    }

    /// Shows the perturbations that may act on `p + s d`, relative to the origin, for `lo <= s <= hi`, by their place
    /// in the form.
    #[inline]
    pub(crate) fn near_ray(&self, p: DVec3, d: DVec3, lo: f64, hi: f64, mut visit: impl FnMut(u32)) {
        match &self.supports {
            None => (0_u32..).zip(&self.perturbations).for_each(|(index, _)| visit(index)),
            Some(supports) => supports.along(p, d, lo, hi, |index, _| visit(index)),
        }
    }

    /// Returns the memory held, bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>()
            + size_of_val(&self.perturbations[..])
            + self.supports.as_ref().map_or(0, |supports| size_of::<Boxes>() + supports.memory_bytes())
    }

    /// Returns the second derivatives of F' at `p`; they are continuous across Q = 0.
    pub fn hessian(&self, p: DVec3) -> DMat3 {
        let p = p - self.origin;
        let mut sum = self.base.hessian();
        for Perturbation { quadric, factor } in &self.perturbations {
            let (q, g) = (quadric.value(p).max(0.0), quadric.gradient(p));
            sum += (3.0 * factor * (q * q)) * quadric.hessian();
            sum += (6.0 * factor * q) * DMat3::from_cols(g * g.x, g * g.y, g * g.z);
        }
        sum
    }

    /// Returns a box that holds every inside point, or says that there may be none.
    pub fn bounds(&self) -> Bounds {
        self.extent.moved(self.origin).to_bounds(self.origin)
    }

    /// Returns a box in world space around the places where F' is `-depth` or more: empty, finite or infinite.
    pub(crate) fn extent_at(&self, depth: f64) -> Extent {
        let extent = if depth == 0.0 { self.extent } else { Extent::of_form(&self.base, &self.perturbations, depth) };
        if extent.is_empty() { Extent::EMPTY } else { extent.moved(self.origin) }
    }

    /// Returns the box relative to the origin, infinite where the form may be.
    pub(crate) fn extent(&self) -> &Extent {
        &self.extent
    }

    /// Returns the form moved by `transform`. A pure translation moves the origin alone and keeps every digit of the
    /// coefficients.
    ///
    /// # Errors
    /// The transformation is singular or not finite, or coefficients overflow.
    pub fn transformed(&self, transform: &DAffine3) -> Result<Self, FormError> {
        inverse(transform)?;
        let origin = transform.transform_point3(self.origin);
        if transform.matrix3 == DMat3::IDENTITY {
            return Self::with_origin(origin, self.base, self.perturbations.clone());
        }
        let turn = DAffine3::from_mat3(transform.matrix3);
        let perturbations = self
            .perturbations
            .iter()
            .map(|&Perturbation { quadric, factor }| Ok(Perturbation { quadric: quadric.transformed(&turn)?, factor }))
            .collect::<Result<_, FormError>>()?;
        Self::with_origin(origin, self.base.transformed(&turn)?, perturbations)
    }
}

impl PartialEq for FreeForm {
    fn eq(&self, other: &Self) -> bool {
        self.origin == other.origin && self.base == other.base && self.perturbations == other.perturbations
    }
}

impl TryFrom<Described> for FreeForm {
    type Error = FormError;

    fn try_from(form: Described) -> Result<Self, FormError> {
        Self::with_origin(form.origin, form.base, form.perturbations)
    }
}

impl From<FreeForm> for Described {
    fn from(form: FreeForm) -> Self {
        Self { origin: form.origin, base: form.base, perturbations: form.perturbations }
    }
}
