//! Solids: free forms and what set operations make of them (eq. 4 of the paper).

use glam::{DAffine3, DVec3};

use crate::{
    Bounds, FormError, FreeForm, Operation, Psi, Quadric,
    bounds::Extent,
    plan::Plan,
    psi::LocalLinear,
    tree::{self, Join, Place, Token},
};

/// Operations may be nested so deep. Some walks over a solid use one frame of the stack a level.
pub const DEPTH_LIMIT: usize = 32;

/// A free form, or solids joined by set operations: a closed set with a function that is not negative inside.
///
/// Union, intersection and difference take any number of parts, so that a body with a hundred holes is one level deep.
#[derive(Debug, Clone)]
pub struct Solid {
    pub(crate) tokens: Vec<Token>,
    pub(crate) forms: Vec<FreeForm>,
    /// Derived: box of the inside.
    extent: Extent,
    /// Derived: what rays need.
    pub(crate) plan: Plan,
}

impl Solid {
    /// Returns what is in any of the parts.
    ///
    /// # Errors
    /// There is no part, the width of a blend is not positive, or operations are nested deeper than [`DEPTH_LIMIT`].
    pub fn union(psi: Psi, parts: Vec<Self>) -> Result<Self, FormError> {
        Self::join(Operation::Union, psi, parts)
    }

    /// Returns what is in all of the parts. Its function is `-psi(-f, -g)`.
    ///
    /// # Errors
    /// As of [`Solid::union`].
    pub fn intersection(psi: Psi, parts: Vec<Self>) -> Result<Self, FormError> {
        Self::join(Operation::Intersection, psi, parts)
    }

    /// Returns what is in the first part and in no other. Its function is `-psi(-f, g)`.
    ///
    /// Solids are closed, and so is their difference: it keeps the surface of what was taken away. What remains without
    /// any thickness is dropped.
    ///
    /// # Errors
    /// As of [`Solid::union`].
    pub fn difference(psi: Psi, parts: Vec<Self>) -> Result<Self, FormError> {
        Self::join(Operation::Difference, psi, parts)
    }

    /// Returns what is not in the solid. Its function is `-f`.
    ///
    /// # Errors
    /// Operations are nested deeper than [`DEPTH_LIMIT`].
    pub fn complement(self) -> Result<Self, FormError> {
        Self::join(Operation::Complement, Psi::Maximum, vec![self])
    }

    /// Returns the box between two corners: the intersection of three slabs.
    ///
    /// # Errors
    /// A corner is not finite, or one of `max` is not greater than that of `min`.
    pub fn cuboid(min: DVec3, max: DVec3) -> Result<Self, FormError> {
        let (middle, half) = (0.5 * (min + max), 0.5 * (max - min));
        let slab = |k: usize| {
            let slab = Quadric::slab(DVec3::ZERO, DVec3::AXES[k], half[k])?;
            FreeForm::with_origin(middle, slab, Vec::new()).map(Self::from)
        };
        let slabs = (0..3).map(slab).collect::<Result<_, _>>()?;
        Self::intersection(Psi::Maximum, slabs)
    }

    /// Returns the part of the solid in the box between two corners: bounds for a cylinder or a paraboloid.
    ///
    /// # Errors
    /// As of [`Solid::cuboid`] and [`Solid::intersection`].
    pub fn clipped(self, min: DVec3, max: DVec3) -> Result<Self, FormError> {
        Self::intersection(Psi::Maximum, vec![self, Self::cuboid(min, max)?])
    }

    /// Returns solids joined by an operation; a complement takes one part.
    ///
    /// # Errors
    /// As of [`Solid::union`]; and a complement of any number of parts but one.
    pub fn join(operation: Operation, psi: Psi, parts: Vec<Self>) -> Result<Self, FormError> {
        if operation == Operation::Complement && parts.len() > 1 {
            return Err(FormError::ManyComplements);
        }
        let psi = if operation == Operation::Complement { Psi::Maximum } else { psi };
        let join = tree::join(operation, psi, parts.iter().map(|part| part.tokens.len()))?;
        let mut tokens = vec![Token::Join(join)];
        let mut forms = Vec::new();
        for part in parts {
            tokens.extend(part.tokens);
            forms.extend(part.forms);
        }
        Self::new(tokens, forms)
    }

    /// Derives what follows from a tree.
    pub(crate) fn new(tokens: Vec<Token>, forms: Vec<FreeForm>) -> Result<Self, FormError> {
        if tree::depth(&tokens) > DEPTH_LIMIT {
            return Err(FormError::TooDeep);
        }
        let extent = tree::extent(&tokens, &forms, &mut Place::default(), 0.0);
        let plan = Plan::new(&tokens, &forms);
        Ok(Self { tokens, forms, extent, plan })
    }

    /// Returns the operation at the top with its psi, `None` for a single form.
    pub fn operation(&self) -> Option<(Operation, Psi)> {
        match self.tokens[0] {
            Token::Form => None,
            Token::Join(Join { operation, psi, .. }) => Some((operation, psi)),
        }
    }

    /// Returns the free forms in the order of the description.
    pub fn forms(&self) -> &[FreeForm] {
        &self.forms
    }

    /// Returns the number of free forms in the solid.
    pub fn form_count(&self) -> usize {
        self.forms.len()
    }

    /// Returns the memory held by the description and by what is derived from it, bytes. Blends hold more from the
    /// first ray on that meets them.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>()
            + size_of_val(&self.tokens[..])
            + self.forms.iter().map(FreeForm::memory_bytes).sum::<usize>()
            + self.plan.memory_bytes()
    }

    /// Returns the box of the inside in world space: empty, finite or infinite.
    pub(crate) fn extent(&self) -> Extent {
        self.extent
    }

    /// Returns the origin of the first form: a point that has to do with the solid, where it has no box.
    pub(crate) fn home(&self) -> DVec3 {
        self.forms[0].origin()
    }

    /// Returns a box that holds every inside point, or says that there may be none.
    pub fn bounds(&self) -> Bounds {
        self.extent.to_bounds(self.home())
    }

    /// Returns the function at `p`: not negative inside. Parts are joined by psi from the first to the last.
    pub fn value(&self, p: DVec3) -> f64 {
        tree::evaluate(&self.tokens, &mut Place::default(), &mut |form| self.forms[form].value(p))
    }

    /// Returns the gradient of the function at `p`; on the surface it points inwards.
    ///
    /// Where it does not exist, on a seam of a union, it is one of its one-sided limits (maximum) or the sum of those
    /// of the parts (R-function).
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        self.local_linear(p, Place::default()).gradient
    }

    /// Returns value and gradient of a subtree at `p` with the size of the terms that the gradient was summed from.
    pub(crate) fn local_linear(&self, p: DVec3, mut place: Place) -> LocalLinear {
        tree::evaluate(&self.tokens, &mut place, &mut |form| self.forms[form].local_linear(p))
    }

    /// Returns the solid moved by `transform`.
    ///
    /// # Errors
    /// The transformation is singular or not finite, or coefficients overflow.
    pub fn transformed(&self, transform: &DAffine3) -> Result<Self, FormError> {
        let forms = self.forms.iter().map(|form| form.transformed(transform)).collect::<Result<_, _>>()?;
        Self::new(self.tokens.clone(), forms)
    }
}

impl PartialEq for Solid {
    fn eq(&self, other: &Self) -> bool {
        self.tokens == other.tokens && self.forms == other.forms
    }
}

impl From<FreeForm> for Solid {
    fn from(form: FreeForm) -> Self {
        let extent = form.extent_at(0.0);
        let (tokens, forms) = (vec![Token::Form], vec![form]);
        let plan = Plan::new(&tokens, &forms);
        Self { tokens, forms, extent, plan }
    }
}
