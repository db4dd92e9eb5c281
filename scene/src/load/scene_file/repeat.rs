//! Copies of a form in rows, layers and at random turns: the `[form.repeat]` of a scene file.

use freeform::{Bounds, Solid};
use glam::{DAffine3, DMat3, DVec3};
use toml::Spanned;

use super::Source;
use super::schema::RepeatTable;
use crate::load::error::LoadError;
use crate::load::limits;
use crate::load::loader::Loader;
use crate::mix;

/// Makes the places of the copies of a form that stands at `center` (what it is turned and scaled about).
pub(super) fn copies(
    table: &Spanned<RepeatTable>,
    solid: &Solid,
    center: DVec3,
    source: &Source,
    loader: &mut Loader<'_>,
) -> Result<Vec<DAffine3>, LoadError> {
    let place = source.place(table.span());
    let RepeatTable { count, step, jitter, turn, size, seed } = table.get_ref();
    let [nx, ny, nz] = count.0;
    let total = count.0.into_iter().map(u64::from).fold(1, u64::saturating_mul);
    loader.count_copies(total, place)?;
    let Bounds::Finite { min, max } = solid.bounds() else {
        return Err(place.invalid("an unbounded form repeated", "clip it"));
    };
    let zero = DVec3::ZERO;
    let (step, jitter) = (step.0, jitter.map_or(zero, |jitter| jitter.0));
    let (turn, size) = (turn.map_or(zero, |turn| turn.0), size.map_or([1.0; 2], |size| size.0));
    let rows = DVec3::new(f64::from(nx - 1), f64::from(ny - 1), f64::from(nz - 1));
    // The farthest that any corner of any copy may be.
    let reach = (min - center).abs().max((max - center).abs()).length() * size[1];
    let farthest = center.abs() + (rows * step).abs() + jitter.abs() + reach;
    if farthest.max_element() > limits::COORDINATE {
        let what = format!("repeated beyond the limit of {:e} metres", limits::COORDINATE);
        return Err(place.invalid(what, "lower the steps"));
    }
    let mut random = Random(*seed);
    let mut copies = Vec::with_capacity(usize::try_from(total).expect("checked against the limit"));
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                // All numbers are drawn for each copy, so that one field changes nothing but what it means.
                let offset = DVec3::new(f64::from(i), f64::from(j), f64::from(k)) * step + jitter * random.signed();
                let angle = (turn * random.signed()).map(f64::to_radians);
                let factor = size[0] + (size[1] - size[0]) * (0.5 + 0.5 * random.signed().x);
                let rotation =
                    DMat3::from_rotation_z(angle.z) * DMat3::from_rotation_y(angle.y) * DMat3::from_rotation_x(angle.x);
                let matrix = rotation * factor;
                copies.push(DAffine3 { matrix3: matrix, translation: center + offset - matrix * center });
            }
        }
    }
    Ok(copies)
}

/// SplitMix64 (Steele, Lea, Flood 2014): the same copies on every machine.
struct Random(u64);

impl Random {
    /// Three numbers in [-1, 1).
    fn signed(&mut self) -> DVec3 {
        let mut next = || {
            self.0 = self.0.wrapping_add(mix::STEP);
            (mix::mixed(self.0) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        DVec3::new(next(), next(), next())
    }
}
