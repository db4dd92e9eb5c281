//! Solids: free forms and their unions (eq. 4 of the paper).

use glam::{DAffine3, DVec3};
use serde::Serialize;

use crate::{Bounds, FormError, FreeForm, bounds::Extent};

/// Unions may be nested so deep. Walks over a solid use one frame of the stack a level.
pub const DEPTH_LIMIT: usize = 32;

/// How the functions of two solids become that of their union (eq. 4). Both give the same set and the same surface; they differ in the values beside it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Psi {
    /// `max(f1, f2)`: the gradient jumps where f1 = f2.
    #[default]
    Maximum,
    /// `f1 + f2 + sqrt(f1^2 + f2^2)`: smooth except on the seam f1 = f2 = 0.
    RFunction,
}

impl Psi {
    fn value(self, f: f64, g: f64) -> f64 {
        match self {
            Self::Maximum => f.max(g),
            // The sum of two negative values cancels the root: the conjugate 2 f g / (f + g - root) does not.
            Self::RFunction if f + g < 0.0 => -2.0 * f * g / (f.hypot(g) - (f + g)),
            Self::RFunction => f + g + f.hypot(g),
        }
    }

    fn join(self, f: LocalLinear, g: LocalLinear) -> LocalLinear {
        match self {
            Self::Maximum if f.value >= g.value => f,
            Self::Maximum => g,
            Self::RFunction => {
                let root = f.value.hypot(g.value);
                // 1 + a / root, without its cancellation where a is negative.
                let share = |a: f64, b: f64| match () {
                    () if root == 0.0 => 1.0,
                    () if a < 0.0 => b * b / (root * (root - a)),
                    () => 1.0 + a / root,
                };
                let (share_f, share_g) = (share(f.value, g.value), share(g.value, f.value));
                LocalLinear {
                    value: self.value(f.value, g.value),
                    gradient: share_f * f.gradient + share_g * g.gradient,
                    weight: share_f * f.weight + share_g * g.weight,
                }
            }
        }
    }
}

/// A function near a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalLinear {
    pub(crate) value: f64,
    pub(crate) gradient: DVec3,
    /// Size of the terms that the gradient was summed from.
    pub(crate) weight: f64,
}

/// A free form or a union of solids: a closed set with a function that is not negative inside.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Solid {
    /// One free form.
    Form(FreeForm),
    /// Several solids together.
    Union(Union),
}

/// Solids together; made by [`Solid::union`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Union {
    psi: Psi,
    parts: Vec<Solid>,
    /// Derived: unions below this one, itself included.
    #[serde(skip)]
    depth: usize,
    /// Derived: box of the inside.
    #[serde(skip)]
    extent: Extent,
}

impl Union {
    /// Checks the parts and derives what follows from them.
    pub(crate) fn new(psi: Psi, parts: Vec<Solid>) -> Result<Self, FormError> {
        let below = parts.iter().map(Solid::depth).max().ok_or(FormError::EmptyUnion)?;
        if below >= DEPTH_LIMIT {
            return Err(FormError::TooDeep);
        }
        let extent = parts.iter().map(Solid::extent).fold(Extent::EMPTY, |sum, part| sum.union(&part));
        Ok(Self { psi, parts, depth: below + 1, extent })
    }

    /// Returns the kind of union.
    pub fn psi(&self) -> Psi {
        self.psi
    }

    /// Returns the parts, at least one.
    pub fn parts(&self) -> &[Solid] {
        &self.parts
    }
}

impl Solid {
    /// Returns the union of solids.
    ///
    /// # Errors
    /// There is no part, or unions are nested deeper than [`DEPTH_LIMIT`].
    pub fn union(psi: Psi, parts: Vec<Self>) -> Result<Self, FormError> {
        Union::new(psi, parts).map(Self::Union)
    }

    fn depth(&self) -> usize {
        match self {
            Self::Form(_) => 0,
            Self::Union(union) => union.depth,
        }
    }

    /// Returns the box of the inside in world space: empty, finite or infinite.
    pub(crate) fn extent(&self) -> Extent {
        match self {
            Self::Form(form) if form.extent().is_empty() => Extent::EMPTY,
            Self::Form(form) => form.extent().moved(form.origin()),
            Self::Union(union) => union.extent,
        }
    }

    /// Returns a box that holds every inside point, or says that there may be none.
    pub fn bounds(&self) -> Bounds {
        self.extent().to_bounds(self.first_form().origin())
    }

    /// Returns the number of free forms in the solid.
    pub fn form_count(&self) -> usize {
        match self {
            Self::Form(_) => 1,
            Self::Union(union) => union.parts.iter().map(Self::form_count).sum(),
        }
    }

    pub(crate) fn first_form(&self) -> &FreeForm {
        match self {
            Self::Form(form) => form,
            Self::Union(union) => union.parts[0].first_form(),
        }
    }

    /// Returns the function at `p`: not negative inside. Parts of a union are joined by psi from the first to the last.
    pub fn value(&self, p: DVec3) -> f64 {
        match self {
            Self::Form(form) => form.value(p),
            Self::Union(union) => union
                .parts
                .iter()
                .map(|part| part.value(p))
                .reduce(|f, g| union.psi.value(f, g))
                .unwrap_or(f64::NEG_INFINITY),
        }
    }

    /// Returns the gradient of the function at `p`; on the surface it points inwards.
    ///
    /// Where it does not exist, on a seam of a union, it is one of its one-sided limits (maximum) or the sum of those of the parts (R-function).
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        self.local_linear(p).gradient
    }

    /// Returns value and gradient at `p` with the size of the terms that the gradient was summed from.
    pub(crate) fn local_linear(&self, p: DVec3) -> LocalLinear {
        match self {
            Self::Form(form) => {
                LocalLinear { value: form.value(p), gradient: form.gradient(p), weight: form.gradient_weight(p) }
            }
            Self::Union(union) => {
                let parts = union.parts.iter().map(|part| part.local_linear(p));
                parts.reduce(|f, g| union.psi.join(f, g)).unwrap_or(LocalLinear {
                    value: f64::NEG_INFINITY,
                    gradient: DVec3::ZERO,
                    weight: 0.0,
                })
            }
        }
    }

    /// Returns the solid moved by `transform`.
    ///
    /// # Errors
    /// The transformation is singular or not finite, or coefficients overflow.
    pub fn transformed(&self, transform: &DAffine3) -> Result<Self, FormError> {
        match self {
            Self::Form(form) => form.transformed(transform).map(Self::Form),
            Self::Union(union) => {
                let parts = union.parts.iter().map(|part| part.transformed(transform)).collect::<Result<_, _>>()?;
                Self::union(union.psi, parts)
            }
        }
    }
}

impl From<FreeForm> for Solid {
    fn from(form: FreeForm) -> Self {
        Self::Form(form)
    }
}
