//! The sides of elements that are silhouettes, laid out as a reprojection reads them.

use std::ops::Range;

use glam::Vec3A;

use crate::silhouette::plane_distance;
use crate::{Elements, LANES};

/// The sides of elements that are silhouettes, in the order of their elements. All of it follows from the other arrays
/// of [`Elements`].
///
/// The arrays are padded to a multiple of [`LANES`] with sides of no length.
///
/// ```
/// use glam::{Vec3, Vec3A};
/// use radcache::{Record, RecordSettings, Samples, Validity};
///
/// // A round lamp overhead, 1 m away, under a black sky.
/// let lamp = |wi: Vec3A| if wi.z > 0.9 { (Vec3::ONE, 1.0 / wi.z, Vec3A::NEG_Z) } else { (Vec3::ZERO, f32::INFINITY, -wi) };
/// let frame = hemimap::Frame::from_normal(Vec3A::Z);
/// let record = Record::new(Vec3A::ZERO, frame, Samples::from_fn(16, lamp), &RecordSettings::default(), &Validity::default());
/// let outline = record.elements().outline();
/// let from = Vec3A::new(0.2, 0.0, 0.0);
/// // Whoever steps to one side sees past the other.
/// let uncovered = (0..outline.len()).filter(|&side| outline.normal(side).dot(from) < 0.0).count();
/// assert!(uncovered > 0 && uncovered < outline.len());
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outline {
    /// The corners at both ends of a side, with the element on the left: corner `k` of element `e` has the number `k *
    /// padded_len + e`.
    pub ends: [Vec<u16>; 2],
    /// Unit normals, towards the side of the element, of the planes through the record and both ends: x, y and z, in
    /// the frame of the record. A point that is off its plane on the other side sees past a silhouette.
    pub normals: [Vec<f32>; 3],
    /// Where in the square the record saw both ends: u.
    pub u: [Vec<f32>; 2],
    /// The same: v.
    pub v: [Vec<f32>; 2],
    /// How far inside of the side the surface may end in truth, in the square: a texel, or nothing where the radiance
    /// of the element knows how much of its texels the background takes, or is of no use elsewhere.
    pub margin: Vec<f32>,
    /// How far what lies behind a side moves when the point does, as a share of how far the side itself moves: the
    /// ratio of their distances, the least along the side; 0 before the surroundings, and where nothing beside the side
    /// is farther.
    pub behind: Vec<f32>,
    /// Start of each layer, and the number of sides at the end.
    layer_starts: Vec<u16>,
}

impl Outline {
    /// Finds the sides of elements whose arrays fit together.
    pub(crate) fn of(elements: &Elements) -> Self {
        let mut outline = Self::default();
        let padded = elements.padded_len();
        let texels = elements.start.iter().zip(&elements.size).take(elements.len());
        let end =
            |axis: usize| texels.clone().map(move |(start, size)| usize::from(start[axis]) + usize::from(size[axis]));
        let columns = end(0).chain(end(1)).fold(1, usize::max);
        let n = columns as f32;
        let owners = owners(elements, columns);
        outline.layer_starts.push(0);
        for layer in 0..elements.layer_count() {
            for e in elements.layer(layer) {
                let blurred = elements.background_share[e] != 0.0 || elements.view_dependent[e];
                let margin = if blurred { 0.0 } else { 1.0 / n };
                for k in (0..4).filter(|&k| elements.sides[e].has(k)) {
                    let [a, b] = [k, (k + 1) % 4].map(|k| elements.corner(e, k).normalize_or_zero());
                    let normal = a.cross(b).normalize_or_zero();
                    outline.margin.push(margin);
                    outline.behind.push(behind(elements, &owners, columns, e, k));
                    outline.normals.iter_mut().zip(normal.to_array()).for_each(|(list, x)| list.push(x));
                    for (end, k) in [k, (k + 1) % 4].into_iter().enumerate() {
                        let [u, v] = elements.grid_corner(e, k);
                        outline.ends[end].push(number(k * padded + e));
                        outline.u[end].push(u / n);
                        outline.v[end].push(v / n);
                    }
                }
            }
            outline.layer_starts.push(number(outline.margin.len()));
        }
        let padded = outline.len().next_multiple_of(LANES);
        let Self { ends, normals, u, v, margin, behind, .. } = &mut outline;
        ends.iter_mut().for_each(|list| list.resize(padded, 0));
        normals.iter_mut().chain(u).chain(v).chain([margin, behind]).for_each(|list| list.resize(padded, 0.0));
        outline
    }

    /// Number of sides.
    #[must_use]
    pub fn len(&self) -> usize {
        self.layer_starts.last().map_or(0, |&count| count.into())
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The sides of the elements of a layer.
    #[must_use]
    pub fn layer(&self, layer: usize) -> Range<usize> {
        self.layer_starts[layer].into()..self.layer_starts[layer + 1].into()
    }

    /// One of the [`Self::normals`].
    #[must_use]
    pub fn normal(&self, side: usize) -> Vec3A {
        let [x, y, z] = &self.normals;
        Vec3A::new(x[side], y[side], z[side])
    }

    /// Bytes that the arrays take.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.margin.len() * (2 * size_of::<u16>() + 9 * size_of::<f32>()) + self.layer_starts.len() * size_of::<u16>()
    }
}

/// The element of each of `n x n` texels.
fn owners(elements: &Elements, n: usize) -> Vec<Option<u16>> {
    let mut owners = vec![None; n * n];
    for e in 0..elements.len() {
        let ([i, j], [w, h]) = (elements.start[e].map(usize::from), elements.size[e].map(usize::from));
        owners.chunks_exact_mut(n).skip(j).take(h).for_each(|row| row[i..i + w].fill(Some(number(e))));
    }
    owners
}

/// See [`Outline::behind`], for side `k` of element `e`.
fn behind(elements: &Elements, owners: &[Option<u16>], n: usize, e: usize, k: usize) -> f32 {
    let ([i, j], [w, h]) = (elements.start[e].map(usize::from), elements.size[e].map(usize::from));
    let [from, to] = [k, (k + 1) % 4].map(|k| elements.corner(e, k));
    let count = if k.is_multiple_of(2) { w } else { h };
    let shares = (0..count).filter_map(|texel| {
        // Sides run round the element.
        let (i, j) = match k {
            0 => (i + texel, j.checked_sub(1)?),
            1 => (i + w, j + texel),
            2 => (i + w - 1 - texel, j + h),
            _ => (i.checked_sub(1)?, j + h - 1 - texel),
        };
        let other = *owners.get(j * n + i).filter(|_| i < n)?;
        let place = from.lerp(to, (texel as f32 + 0.5) / count as f32);
        Some(place.length() / distance(elements, other?.into(), place))
    });
    // Beside a part of the side, the surface may run on.
    let least = shares.filter(|&share| share < 1.0).fold(1.0, f32::min);
    if least < 1.0 { least } else { 0.0 }
}

/// The distance of element `e` towards a point, on its plane, but no nearer and no farther than its corners.
fn distance(elements: &Elements, e: usize, towards: Vec3A) -> f32 {
    if elements.finite[e] == 0.0 {
        return f32::INFINITY;
    }
    let corners = [0, 1, 2, 3].map(|k| elements.corner(e, k));
    let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
    let distances = corners.map(Vec3A::length);
    let [nearest, farthest] = [f32::min, f32::max].map(|choose| distances.into_iter().reduce(choose).expect("four"));
    // Not by `clamp`, which panics on bounds that are no numbers: what is read is checked only after the outline is
    // found.
    plane_distance(corners[0], normal, towards.normalize_or_zero()).max(nearest).min(farthest)
}

fn number(corner: usize) -> u16 {
    u16::try_from(corner).expect("at most 4 x 64 x 64 corners")
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{MergeSettings, Samples};

    /// A disc 1 m overhead, under the sky. Some of its texels see a little of that.
    fn disc(n: usize) -> Elements {
        let mut samples = Samples::from_fn(n, |wi| {
            if wi.z > 0.8 { (Vec3::ONE, 1.0 / wi.z, Vec3A::NEG_Z) } else { (Vec3::ONE, f32::INFINITY, -wi) }
        });
        for texel in (0..n * n).filter(|&texel| texel % n < n / 2 && samples.distance[texel].is_finite()) {
            samples.background_share[texel] = 0.1;
        }
        Elements::new(&samples, 4, &MergeSettings::default())
    }

    /// The element of a corner and which of its corners it is.
    fn corner(elements: &Elements, number: u16) -> (usize, usize) {
        (usize::from(number) % elements.padded_len(), usize::from(number) / elements.padded_len())
    }

    #[test]
    fn holds_every_silhouette_in_the_order_of_elements() {
        let elements = disc(16);
        let outline = elements.outline();
        let mut sides = 0..;
        for e in 0..elements.len() {
            for k in (0..4).filter(|&k| elements.sides[e].has(k)) {
                let side = sides.next().unwrap();
                assert_eq!(usize::from(outline.ends[0][side]), k * elements.padded_len() + e, "begins at corner {k}");
                assert_eq!([outline.u[0][side], outline.v[0][side]].map(|x| x * 16.0), elements.grid_corner(e, k));
                let middle = (0..4).map(|k| elements.corner(e, k)).sum::<Vec3A>();
                assert!(outline.normal(side).dot(middle) > 0.0, "points into the element");
                let is_sharp = elements.background_share[e] == 0.0;
                assert_eq!(outline.margin[side], if is_sharp { 1.0 / 16.0 } else { 0.0 }, "a texel where it is sharp");
            }
        }
        assert_eq!(sides.start, outline.len(), "and nothing else");
        assert!(outline.margin[..outline.len()].contains(&0.0) && outline.margin.contains(&(1.0 / 16.0)), "both kinds");
        let layers: Vec<_> = (0..elements.layer_count()).flat_map(|layer| outline.layer(layer)).collect();
        assert!(layers.into_iter().eq(0..outline.len()), "layers follow each other and hold all");
    }

    #[test]
    fn what_lies_behind_follows_by_its_distance() {
        // A quarter turn brings each side of the elements to the edge.
        let turns: [fn(Vec3A) -> f32; 4] = [|wi| wi.x, |wi| wi.y, |wi| -wi.x, |wi| -wi.y];
        for (turn, across) in turns.into_iter().enumerate() {
            // A near half-plane before a far plane that leans towards its edge, and that before the sky.
            let samples = Samples::from_fn(32, |wi| {
                let (near, far) = (1.0 / wi.z, 4.0 / (wi.z - 0.5 * across(wi)));
                if across(wi) * near < 0.3 {
                    (Vec3::X, near, Vec3A::NEG_Z)
                } else if across(wi) < 0.6 {
                    let towards_edge = Vec3A::from_array(Vec3A::AXES.map(across));
                    (Vec3::Y, far, (0.5 * towards_edge - Vec3A::Z).normalize())
                } else {
                    (Vec3::Z, f32::INFINITY, -wi)
                }
            });
            let elements = Elements::new(&samples, 16, &MergeSettings::default());
            let outline = elements.outline();
            let mut found = [0; 2];
            for side in 0..outline.len() {
                let (e, k) = corner(&elements, outline.ends[0][side]);
                if elements.radiance[0][e] == 0.0 {
                    assert_eq!(outline.behind[side], 0.0, "the sky does not move");
                    found[0] += 1;
                    continue;
                }
                // The directions of both ends, where planes are 1 and 4 away.
                let ends = [0, 1].map(|end| {
                    let (e, k) = corner(&elements, outline.ends[end][side]);
                    elements.corner(e, k).normalize()
                });
                // Where planes are seen flatly, corners are held back.
                if ends.iter().all(|wi| wi.z >= 0.5) {
                    let least = ends.map(|wi| (wi.z - 0.5 * across(wi)) / (4.0 * wi.z)).into_iter().fold(1.0, f32::min);
                    let behind = outline.behind[side];
                    assert!((behind / least - 1.0).abs() < 0.1, "turn {turn}, side {k}: {behind} for {least}");
                    found[1] += usize::from(k == [1, 2, 3, 0][turn]);
                }
            }
            assert!(found[0] > 5 && found[1] > 5, "turn {turn}: both kinds of silhouette: {found:?}");
        }
    }

    #[test]
    fn padding_is_no_side() {
        let outline = disc(16).outline().clone();
        let padded = outline.margin.len();
        assert!(padded.is_multiple_of(LANES) && padded > outline.len(), "{} sides", outline.len());
        for side in outline.len()..padded {
            assert_eq!(outline.normal(side), Vec3A::ZERO, "never retreats");
        }
    }
}
