//! Free forms of a scene file.

use std::ops::Range;

use freeform::{FormError, FreeForm, Operation, Perturbation, Psi, Quadric, Solid, TextError};
use glam::{DAffine3, DVec3};
use toml::Spanned;

use super::Source;
use super::build::transformation;
use super::schema::{ClipTable, FormTable, PartTable, PerturbationTable, ProjectionTable, PsiTable, QuadricTable};
use super::values::{Length, Point};
use crate::Projection;
use crate::load::error::LoadError;

/// The [`Shape`] of a table: a form's or a part's, which have these fields by the same names.
macro_rules! shape {
    ($table:expr) => {{
        let table = $table.get_ref();
        Shape {
            span: $table.span(),
            text: table.text.as_ref(),
            form: FormShape {
                origin: table.origin,
                quadric: table.quadric.as_ref(),
                perturbations: &table.perturbations,
                weight: table.weight,
            },
            operations: [
                (Operation::Union, table.union.as_deref()),
                (Operation::Intersection, table.intersection.as_deref()),
                (Operation::Difference, table.difference.as_deref()),
                (Operation::Complement, table.complement.as_deref().map(std::slice::from_ref)),
            ],
            psi: table.psi,
            clip: table.clip.as_ref(),
            transform: transformation(table.scale, table.rotate, table.translate),
        }
    }};
}

/// Makes the solid of a `[[form]]`.
pub(super) fn solid(table: &Spanned<FormTable>, source: &Source) -> Result<Solid, LoadError> {
    shape!(table).solid(source)
}

/// Makes the projection of a `[[form]]`, which is placed with the form.
pub(super) fn projection(table: &FormTable, source: &Source) -> Result<Option<Projection>, LoadError> {
    let Some(projection) = &table.projection else { return Ok(None) };
    let place = source.place(projection.span());
    let point = |point: Option<Point>| point.map_or(DVec3::ZERO, |point| point.0);
    let projection = match *projection.get_ref() {
        ProjectionTable::Planar { origin, right, up } => {
            Projection::planar(point(origin), right.0, up.0).ok_or_else(|| {
                place.invalid("right and up are parallel or of length zero", "give two edges of the picture")
            })?
        }
        ProjectionTable::Spherical { center, axis, front } => {
            let axis = axis.map_or(DVec3::Y, |axis| axis.0);
            let front = front.map_or(DVec3::Z, |front| front.0);
            Projection::spherical(point(center), axis, front).ok_or_else(|| {
                place.invalid("front is parallel to the axis", "give another front, such as front = [1, 0, 0]")
            })?
        }
        ProjectionTable::Box { center, size } => Projection::cube(point(center), size.0),
    };
    Ok(Some(match transformation(table.scale, table.rotate, table.translate) {
        Some(transform) => projection.transformed(&transform),
        None => projection,
    }))
}

/// Makes the solid of a part of a set operation. It calls itself for parts of parts, as deep as the reader of the file
/// allows.
fn part(table: &Spanned<PartTable>, source: &Source) -> Result<Solid, LoadError> {
    shape!(table).solid(source)
}

/// What forms and parts have in common.
struct Shape<'a> {
    span: Range<usize>,
    /// All of it in the words of [`Solid`]'s text.
    text: Option<&'a Spanned<String>>,
    form: FormShape<'a>,
    operations: [(Operation, Option<&'a [Spanned<PartTable>]>); 4],
    psi: Option<PsiTable>,
    clip: Option<&'a Spanned<ClipTable>>,
    transform: Option<DAffine3>,
}

/// A single free form.
struct FormShape<'a> {
    origin: Option<Point>,
    quadric: Option<&'a Spanned<QuadricTable>>,
    perturbations: &'a [Spanned<PerturbationTable>],
    weight: Option<Length>,
}

impl Shape<'_> {
    fn solid(self, source: &Source) -> Result<Solid, LoadError> {
        let refuse = |error| refused(&error, self.span.clone(), source);
        let mut solid = match self.text {
            Some(text) => self.read(text, source)?,
            None => self.assembled(source)?,
        };
        if let Some(clip) = self.clip {
            let ClipTable { min, max } = clip.get_ref();
            solid = solid.clipped(min.0, max.0).map_err(|error| match error {
                FormError::OutOfRange(_) => source
                    .place(clip.span())
                    .invalid("a clip without inside", "let each coordinate of max exceed that of min"),
                error => refuse(error),
            })?;
        }
        match &self.transform {
            Some(transform) => solid.transformed(transform).map_err(refuse),
            None => Ok(solid),
        }
    }

    /// Makes the solid that the text says.
    fn read(&self, text: &Spanned<String>, source: &Source) -> Result<Solid, LoadError> {
        let has_form = self.form.quadric.is_some() || self.form.has_more_than_a_quadric();
        if has_form || self.psi.is_some() || self.operations.iter().any(|(_, parts)| parts.is_some()) {
            let what = "text beside a quadric, what belongs to one, or a set operation";
            return Err(source.place(self.span.clone()).invalid(what, "write all of it in the text, or none"));
        }
        let refuse = |TextError { line, what }| {
            source.place(text.span()).invalid(format!("line {line} of the text: {what}"), "correct the text")
        };
        text.get_ref().parse().map_err(refuse)
    }

    /// Makes the solid of a quadric or of a set operation.
    fn assembled(&self, source: &Source) -> Result<Solid, LoadError> {
        let place = source.place(self.span.clone());
        let refuse = |error| refused(&error, self.span.clone(), source);
        let mut given = self.operations.iter().filter_map(|(operation, parts)| parts.map(|parts| (*operation, parts)));
        match (self.form.quadric, given.next(), given.next()) {
            (Some(_), None, _) if self.psi.is_some() => {
                Err(place.invalid("psi without a set operation", "remove psi, or write union = [...]"))
            }
            (Some(base), None, _) => Ok(Solid::from(self.form.form(base, &self.span, source)?)),
            (None, Some((operation, parts)), None) => {
                if self.form.has_more_than_a_quadric() {
                    let what = format!("{} with perturbations, an origin or a weight", operation.name());
                    return Err(place.invalid(what, "give them to its parts"));
                }
                if operation == Operation::Complement && self.psi.is_some() {
                    return Err(place.invalid("complement with psi", "remove psi"));
                }
                let parts = parts.iter().map(|table| part(table, source)).collect::<Result<_, LoadError>>()?;
                Solid::join(operation, self.psi.map_or(Psi::Maximum, psi), parts).map_err(refuse)
            }
            (None, Some((first, _)), Some((second, _))) => {
                let what = format!("both {} and {}", first.name(), second.name());
                Err(place.invalid(what, "keep one, or make one a part of the other"))
            }
            (Some(_), Some((operation, _)), _) => {
                Err(place.invalid(format!("both quadric and {}", operation.name()), "keep one"))
            }
            (None, None, _) => {
                let advice = "write quadric = { sphere = { ... } }, union = [...] or text = \"...\"";
                Err(place.invalid("a form without a quadric", advice))
            }
        }
    }
}

impl FormShape<'_> {
    /// Whether anything is given that belongs to a quadric.
    fn has_more_than_a_quadric(&self) -> bool {
        !self.perturbations.is_empty() || self.origin.is_some() || self.weight.is_some()
    }

    fn form(&self, base: &Spanned<QuadricTable>, span: &Range<usize>, source: &Source) -> Result<FreeForm, LoadError> {
        let refuse = |error| refused(&error, span.clone(), source);
        let base = quadric(base, source)?;
        let perturbation = |table: &Spanned<PerturbationTable>| {
            let PerturbationTable { quadric: shape, factor, scale, rotate, translate } = table.get_ref();
            let mut quadric = quadric(shape, source)?;
            if let Some(transform) = transformation(*scale, *rotate, *translate) {
                quadric = quadric.transformed(&transform).map_err(|error| refused(&error, table.span(), source))?;
            }
            Ok(Perturbation { quadric, factor: factor.0 })
        };
        let perturbations = self.perturbations.iter().map(perturbation).collect::<Result<_, LoadError>>()?;
        let origin = self.origin.map_or(DVec3::ZERO, |point| point.0);
        let form = FreeForm::with_origin(origin, base, perturbations).map_err(refuse)?;
        match self.weight {
            Some(weight) => form.weighted(weight.0).map_err(refuse),
            None => Ok(form),
        }
    }
}

fn psi(table: PsiTable) -> Psi {
    match table {
        PsiTable::Maximum => Psi::Maximum,
        PsiTable::RFunction => Psi::RFunction,
        PsiTable::Blend { width } => Psi::Blend { width: width.0 },
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
        Q::OneSheet { center, axis, radius, slope } => Quadric::one_sheet(center.0, axis.0, radius.0, slope.0),
        Q::TwoSheets { center, axis, height, slope } => Quadric::two_sheets(center.0, axis.0, height.0, slope.0),
        Q::Saddle { point, axis, along, rise, fall } => Quadric::saddle(point.0, axis.0, along.0, rise.0, fall.0),
        Q::HalfSpace { point, normal } => Quadric::half_space(point.0, normal.0),
        Q::Slab { point, normal, half_thickness } => Quadric::slab(point.0, normal.0, half_thickness.0),
    };
    quadric.map_err(|error| refused(&error, table.span(), source))
}

/// The error of a form at its place; its text reads `what; do this`.
fn refused(error: &FormError, span: Range<usize>, source: &Source) -> LoadError {
    let text = error.to_string();
    let (what, advice) = text.split_once("; ").unwrap_or((&text, "correct the form"));
    source.place(span).invalid(what, advice)
}
