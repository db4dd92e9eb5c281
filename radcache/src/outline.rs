//! The sides of elements that are silhouettes, laid out as a reprojection reads them.

use std::ops::Range;

use glam::Vec3A;

use crate::{Elements, LANES};

/// The sides of elements that are silhouettes, in the order of their elements. All of it follows from the other arrays of [`Elements`].
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
    /// The corners at both ends of a side, with the element on the left: corner `k` of element `e` has the number `k * padded_len + e`.
    pub ends: [Vec<u16>; 2],
    /// Unit normals, towards the side of the element, of the planes through the record and both ends: x, y and z, in the frame of the record. A point that is
    /// off its plane on the other side sees past a silhouette.
    pub normals: [Vec<f32>; 3],
    /// Where in the square the record saw both ends: u.
    pub u: [Vec<f32>; 2],
    /// The same: v.
    pub v: [Vec<f32>; 2],
    /// How far inside of the side the surface may end in truth, in the square: a texel, or nothing where the radiance of the element knows how much of its
    /// texels the background takes, or is of no use elsewhere.
    pub margin: Vec<f32>,
    /// Start of each layer, and the number of sides at the end.
    layer_starts: Vec<u16>,
}

impl Outline {
    /// Finds the sides of elements whose arrays fit together.
    pub(crate) fn of(elements: &Elements) -> Self {
        let mut outline = Self::default();
        let padded = elements.padded_len();
        let texels = elements.start.iter().zip(&elements.size).take(elements.len());
        let n = texels.map(|(start, size)| f32::from(start[0]) + f32::from(size[0])).fold(1.0, f32::max);
        outline.layer_starts.push(0);
        for layer in 0..elements.layer_count() {
            for e in elements.layer(layer) {
                let blurred = elements.background_share[e] != 0.0 || elements.view_dependent[e];
                let margin = if blurred { 0.0 } else { 1.0 / n };
                for k in (0..4).filter(|&k| elements.sides[e].has(k)) {
                    let [a, b] = [k, (k + 1) % 4].map(|k| elements.corner(e, k).normalize_or_zero());
                    let normal = a.cross(b).normalize_or_zero();
                    outline.margin.push(margin);
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
        let Self { ends, normals, u, v, margin, .. } = &mut outline;
        ends.iter_mut().for_each(|list| list.resize(padded, 0));
        normals.iter_mut().chain(u).chain(v).chain([margin]).for_each(|list| list.resize(padded, 0.0));
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
        self.margin.len() * (2 * size_of::<u16>() + 8 * size_of::<f32>()) + self.layer_starts.len() * size_of::<u16>()
    }
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
    fn padding_is_no_side() {
        let outline = disc(16).outline().clone();
        let padded = outline.margin.len();
        assert!(padded.is_multiple_of(LANES) && padded > outline.len(), "{} sides", outline.len());
        for side in outline.len()..padded {
            assert_eq!(outline.normal(side), Vec3A::ZERO, "never retreats");
        }
    }
}
