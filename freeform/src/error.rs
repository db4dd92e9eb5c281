//! What can be wrong with a description of a form.

use crate::solid::DEPTH_LIMIT;

/// Says why a quadric, a form or a union was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormError {
    /// A coefficient is NaN or infinite.
    #[error("coefficient {index} of a quadric is not finite; give ten finite numbers")]
    CoefficientNotFinite {
        /// Place in the order A11 A22 A33 A12 A13 A23 A14 A24 A34 A44, from 0.
        index: usize,
    },
    /// All coefficients are zero: the function is 0 everywhere and says nothing.
    #[error("all ten coefficients of a quadric are zero; at least one must not be")]
    AllZero,
    /// The factor of a perturbation is NaN or infinite.
    #[error("the factor of perturbation {index} is not finite; give a finite number")]
    FactorNotFinite {
        /// Place in the list of perturbations, from 0.
        index: usize,
    },
    /// A centre, radius, point or origin is NaN or infinite, or a length that must be positive is not.
    #[error("{0} is out of range; points must be finite, lengths positive and directions not zero")]
    OutOfRange(&'static str),
    /// A transformation that cannot be undone was asked for.
    #[error("the transformation is singular; it flattens the form")]
    Singular,
    /// A set operation without parts; its name.
    #[error("no parts in the {0}; give it at least one")]
    Empty(&'static str),
    /// A complement of several parts.
    #[error("a complement takes one part; unite the parts first")]
    ManyComplements,
    /// More parts than can be numbered.
    #[error("too many parts; divide the solid into several")]
    TooMany,
    /// Set operations inside each other beyond the limit.
    #[error("set operations are nested deeper than {DEPTH_LIMIT}; put parts side by side in one operation")]
    TooDeep,
}
