//! Free forms (eqs. 2 and 3 of the paper): a base quadric, swollen and dented by cubed quadrics.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::{Bounds, FormError, Quadric, bounds::Extent, quadric::inverse};

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
/// Twice continuously differentiable everywhere. Coefficients are relative to `origin`, so that a form far from the world's origin keeps its digits: move a
/// form by its origin, not by its coefficients.
///
/// # Source
/// Equations 1 to 3 of the paper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Described", into = "Described")]
pub struct FreeForm {
    origin: DVec3,
    base: Quadric,
    perturbations: Vec<Perturbation>,
    /// Derived: box of the inside, relative to the origin.
    extent: Extent,
}

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
    /// A number is not finite, or a quadric is zero everywhere. A base of zero would make all space outside the perturbations solid.
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
        let extent = Extent::of_form(&base, &perturbations);
        Ok(Self { origin, base, perturbations, extent })
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
        let perturbations = self.perturbations.iter().map(|Perturbation { quadric, factor }| {
            let q = quadric.value(p).max(0.0);
            factor * (q * q * q)
        });
        self.base.value(p) + perturbations.sum::<f64>()
    }

    /// Returns the gradient of F' at `p`: grad F + sum 3 f Q^2 grad Q over the positive Q. It points inwards on the surface.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let p = p - self.origin;
        let perturbations = self.perturbations.iter().map(|Perturbation { quadric, factor }| {
            let q = quadric.value(p).max(0.0);
            (3.0 * factor * (q * q)) * quadric.gradient(p)
        });
        self.base.gradient(p) + perturbations.sum::<DVec3>()
    }

    /// Returns the size of the terms that the gradient at `p` is summed from.
    pub(crate) fn gradient_weight(&self, p: DVec3) -> f64 {
        let p = p - self.origin;
        let perturbations = self.perturbations.iter().map(|Perturbation { quadric, factor }| {
            let q = quadric.value(p).max(0.0);
            3.0 * factor.abs() * (q * q) * quadric.gradient_weight(p).max_element()
        });
        self.base.gradient_weight(p).max_element() + perturbations.sum::<f64>()
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

    /// Returns the box relative to the origin, infinite where the form may be.
    pub(crate) fn extent(&self) -> &Extent {
        &self.extent
    }

    /// Returns the form moved by `transform`. A pure translation moves the origin alone and keeps every digit of the coefficients.
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
