//! Free forms of a scene file.

use freeform::{FormError, FreeForm, Perturbation, Psi, Quadric, Solid};
use glam::DVec3;
use toml::Spanned;

use super::Source;
use super::schema::{FormTable, PartTable, PerturbationTable, QuadricTable};
use super::values::Point;
use crate::load::error::LoadError;

/// Makes the solid of a `[[form]]`, before its transformation.
pub(super) fn solid(table: &Spanned<FormTable>, source: &Source) -> Result<Solid, LoadError> {
    let FormTable { origin, quadric, perturbations, union, psi, .. } = table.get_ref();
    let shape = Shape {
        span: table.span(),
        origin: *origin,
        quadric: quadric.as_ref(),
        perturbations,
        union: union.as_deref(),
        psi: *psi,
    };
    shape.solid(source)
}

/// What forms and parts of unions have in common.
struct Shape<'a> {
    span: std::ops::Range<usize>,
    origin: Option<Point>,
    quadric: Option<&'a Spanned<QuadricTable>>,
    perturbations: &'a [Spanned<PerturbationTable>],
    union: Option<&'a [Spanned<PartTable>]>,
    psi: Option<Psi>,
}

impl Shape<'_> {
    fn solid(&self, source: &Source) -> Result<Solid, LoadError> {
        let place = source.place(self.span.clone());
        match (self.quadric, self.union) {
            (Some(base), None) => {
                if self.psi.is_some() {
                    return Err(place.invalid("psi without a union", "remove psi, or write union = [...]"));
                }
                let base = quadric(base, source)?;
                let perturbation = |table: &Spanned<PerturbationTable>| {
                    let PerturbationTable { quadric: shape, factor } = table.get_ref();
                    Ok(Perturbation { quadric: quadric(shape, source)?, factor: factor.0 })
                };
                let perturbations = self.perturbations.iter().map(perturbation).collect::<Result<_, LoadError>>()?;
                let origin = self.origin.map_or(DVec3::ZERO, |point| point.0);
                let form = FreeForm::with_origin(origin, base, perturbations);
                form.map(Solid::Form).map_err(|error| refused(&error, self.span.clone(), source))
            }
            (None, Some(parts)) => {
                if !self.perturbations.is_empty() || self.origin.is_some() {
                    return Err(place.invalid("a union with perturbations or an origin", "give them to its parts"));
                }
                let part = |part: &Spanned<PartTable>| {
                    let PartTable { origin, quadric, perturbations, union, psi } = part.get_ref();
                    let union = union.as_deref();
                    Shape {
                        span: part.span(),
                        origin: *origin,
                        quadric: quadric.as_ref(),
                        perturbations,
                        union,
                        psi: *psi,
                    }
                    .solid(source)
                };
                let parts = parts.iter().map(part).collect::<Result<_, LoadError>>()?;
                Solid::union(self.psi.unwrap_or_default(), parts)
                    .map_err(|error| refused(&error, self.span.clone(), source))
            }
            (Some(_), Some(_)) => Err(place.invalid("both a quadric and a union", "keep one")),
            (None, None) => {
                Err(place.invalid("a form without a quadric", "write quadric = { sphere = { ... } }, or union = [...]"))
            }
        }
    }
}

fn quadric(table: &Spanned<QuadricTable>, source: &Source) -> Result<Quadric, LoadError> {
    use QuadricTable as Q;
    let quadric = match *table.get_ref() {
        Q::Coefficients(coefficients) => Quadric::new(coefficients.0),
        Q::Ellipsoid { center, radii } => Quadric::ellipsoid(center.0, radii.0),
        Q::Sphere { center, radius } => Quadric::sphere(center.0, radius.0),
        Q::Cylinder { point, axis, radius } => Quadric::cylinder(point.0, axis.0, radius.0),
        Q::Cone { apex, axis, slope } => Quadric::cone(apex.0, axis.0, slope.0),
        Q::Paraboloid { vertex, axis, focal_length } => Quadric::paraboloid(vertex.0, axis.0, focal_length.0),
        Q::HalfSpace { point, normal } => Quadric::half_space(point.0, normal.0),
        Q::Slab { point, normal, half_thickness } => Quadric::slab(point.0, normal.0, half_thickness.0),
    };
    quadric.map_err(|error| refused(&error, table.span(), source))
}

/// The error of a form at its place; its text reads `what; do this`.
pub(super) fn refused(error: &FormError, span: std::ops::Range<usize>, source: &Source) -> LoadError {
    let text = error.to_string();
    let (what, advice) = text.split_once("; ").unwrap_or((&text, "correct the form"));
    source.place(span).invalid(what, advice)
}
