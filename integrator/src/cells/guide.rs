//! Where indirect light comes from, where few directions bring it: through a door that is ajar, from a ceiling that a
//! lamp lights from below, from a patch of sun.
//!
//! The links of cells tell it. Cells that face the same side are divided in space as long as both halves know enough
//! bright ends of links. A part in which few links bring most of the light keeps these ends, its glints; any point of it
//! sees them, and sends its rays there more often: first cells, whose links are made anew, then gathers. Numbers of rays
//! and their chances depend on links that are not counted themselves; only whether links of a part are made anew is
//! decided by those that are kept if not.
//!
//! # Source
//! Jensen 1995, *Importance driven path tracing using the photon map*; Müller, Gross and Novák 2017, *Practical path
//! guiding for efficient light-transport simulation*, for the adaptive division of space.

use std::iter::zip;
use std::ops::Range;

use glam::{IVec2, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use rayon::prelude::*;
use scene::Aabb;

use super::probe::FoundCell;
use super::side_of;
use super::solve::{CellLight, Row};
use crate::sky::luminance;

/// A part of space is divided as long as the light of both halves comes by so many links, if all were equally bright.
const MIN_HITS: f32 = 64.0;
/// Gathers are guided where a smaller share of the links than this would bring the light, links where one smaller than
/// the other: another round of them takes longer than a few more rays of gathers.
const GUIDED_GATHERS: f32 = 0.15;
const GUIDED_LINKS: f32 = 0.05;
/// Most glints of a part, those that weigh most.
const MAX_GLINTS: usize = 128;
/// No glint is brighter, however near it is: sums of all are numbers.
const BRIGHTEST: f32 = 1e12;
/// The solid angle of links that left their point at a smaller cosine is taken as at this one.
const MIN_COS: f32 = 0.05;

/// What a link met first.
#[derive(Debug, Clone)]
pub(super) struct LinkEnd {
    /// Where it is, or the direction where that is infinitely far.
    pub(super) at: Vec3,
    /// Its distance, metres.
    pub(super) distance: f32,
    /// The cosine at the start of the link.
    pub(super) cos: f32,
    /// The share of the cosine-weighted hemisphere for which the link stands.
    pub(super) share: f32,
    /// What it brought: these links of its row, and luminance besides.
    pub(super) links: Range<u32>,
    pub(super) source: f32,
}

/// Something around a point that is much brighter than the rest, as few rays met it.
///
/// ```
/// # use integrator::Glint;
/// # use scene::glam::Vec3A;
/// // A part of the sky straight overhead, of 0.01 sr and a hundred times as bright as what is seen on average.
/// let sun_behind_clouds = Glint { at: Vec3A::Y, is_far: true, weight: 100.0 * 100.0 * 0.01 };
/// # assert!(sun_behind_clouds.weight > 0.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glint {
    /// Where it is, world space, metres; the unit direction to it where it is infinitely far.
    pub at: Vec3A,
    /// Whether it is infinitely far.
    pub is_far: bool,
    /// The square of its radiance, relative to the mean over the hemispheres around, times what it stands for: its area
    /// across the line of sight, square metres, or its solid angle, sr, where it is infinitely far.
    pub weight: f32,
}

/// Glints by place and side.
#[derive(Debug, Default)]
pub(super) struct Guide {
    nodes: Vec<Node>,
    /// The node of all cells of each side.
    roots: [Option<usize>; 6],
    glints: Vec<Glint>,
}

/// A part of space.
#[derive(Debug)]
enum Node {
    Split { axis: usize, at: f32, children: [usize; 2] },
    Leaf { glints: Range<usize>, sums: Sums },
}

/// A cell and the radiance that each of its links brought.
struct Member<'a> {
    centre: Vec3A,
    ends: Vec<(&'a LinkEnd, f32)>,
    sums: Sums,
}

/// Sums over links.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    share: f32,
    /// Of the radiance L by the shares s, of L^2 s, and of L^2 s^2.
    light: f32,
    light_sq: f32,
    squares: f32,
}

impl Guide {
    /// Learns from the links of cells; `None` where light comes from everywhere.
    pub(super) fn new(found: &[FoundCell], rows: &[Row], light: &[CellLight]) -> Option<Self> {
        let mut sides: [Vec<Member<'_>>; 6] = Default::default();
        let members =
            found.par_iter().zip(rows).map(|(cell, row)| (side_of(cell.points[0].ng), Member::new(cell, row, light)));
        for (side, member) in members.collect::<Vec<_>>() {
            sides[side].push(member);
        }
        let mut guide = Self::default();
        for (root, members) in sides.iter_mut().enumerate() {
            guide.roots[root] = (!members.is_empty()).then(|| guide.divide(members));
        }
        (!guide.glints.is_empty()).then_some(guide)
    }

    /// Whether any links are to be guided.
    pub(super) fn helps_links(&self) -> bool {
        self.nodes.iter().any(|node| matches!(node, Node::Leaf { sums, .. } if sums.lit_share() < GUIDED_LINKS))
    }

    /// The glints that a surface sees, where they help its gathers.
    pub(super) fn glints(&self, p: Vec3A, ng: Vec3A) -> &[Glint] {
        self.leaf(p, ng).map_or(&[], |(glints, _)| glints)
    }

    /// The same for its links, if these are to be made anew: where few of them bring the light, and where they met so
    /// little that this is not known. If only those were that met something, what others missed by chance would be lost.
    pub(super) fn glints_for_links(&self, p: Vec3A, ng: Vec3A) -> Option<&[Glint]> {
        let (glints, sums) = self.leaf(p, ng)?;
        (sums.lit_share() < GUIDED_LINKS || sums.hits() < MIN_HITS).then_some(glints)
    }

    fn leaf(&self, p: Vec3A, ng: Vec3A) -> Option<(&[Glint], &Sums)> {
        let mut node = self.roots[side_of(ng)]?;
        loop {
            match &self.nodes[node] {
                &Node::Split { axis, at, children } => node = children[usize::from(p[axis] >= at)],
                Node::Leaf { glints, sums } => return Some((&self.glints[glints.clone()], sums)),
            }
        }
    }

    /// Bytes that it takes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.glints.capacity() * size_of::<Glint>()
    }

    /// Makes the node of some cells and those below it. Recursion halves the cells.
    fn divide(&mut self, members: &mut [Member<'_>]) -> usize {
        let number = self.nodes.len();
        let bounds =
            members.iter().map(|member| Aabb::of_points(&[member.centre.into()])).fold(Aabb::EMPTY, Aabb::union);
        let axis = (bounds.max - bounds.min).max_position();
        let middle = members.len() / 2;
        members.select_nth_unstable_by(middle, |a, b| a.centre[axis].total_cmp(&b.centre[axis]));
        let (before, after) = members.split_at_mut(middle);
        if Sums::of(before).hits() >= MIN_HITS && Sums::of(after).hits() >= MIN_HITS {
            let at = after[0].centre[axis];
            self.nodes.push(Node::Split { axis, at, children: [0; 2] });
            let below = [self.divide(before), self.divide(after)];
            self.nodes[number] = Node::Split { axis, at, children: below };
        } else {
            let sums = Sums::of(members);
            let first = self.glints.len();
            if sums.lit_share() < GUIDED_GATHERS {
                self.glints.extend(glints(members, &sums));
            }
            self.nodes.push(Node::Leaf { glints: first..self.glints.len(), sums });
        }
        number
    }
}

/// What is brighter than the mean of all that some cells see.
fn glints(members: &[Member<'_>], sums: &Sums) -> Vec<Glint> {
    let mean = sums.light / sums.share;
    let ends = members.iter().flat_map(|member| &member.ends).filter(|(_, radiance)| *radiance > mean);
    // The mean square of the radiance that each stands for.
    let mut ends: Vec<(&LinkEnd, f32)> =
        ends.map(|&(end, radiance)| (end, (radiance / mean).powi(2) * end.share / sums.share)).collect();
    ends.sort_by(|a, b| b.1.total_cmp(&a.1));
    let sum = |ends: &[(&LinkEnd, f32)]| ends.iter().map(|end| end.1).sum::<f32>();
    let all = sum(&ends);
    ends.truncate(MAX_GLINTS);
    let scale = all / sum(&ends);
    let glint = |(end, square): (&LinkEnd, f32)| {
        let is_far = end.distance.is_infinite();
        let across = if is_far { 1.0 } else { end.distance * end.distance };
        let weight = scale * square * std::f32::consts::PI / end.cos.max(MIN_COS) * across;
        Glint { at: end.at.into(), is_far, weight }
    };
    ends.into_iter().map(glint).collect()
}

impl<'a> Member<'a> {
    fn new(cell: &FoundCell, row: &'a Row, light: &[CellLight]) -> Self {
        let centre = cell.points.iter().map(|point| point.p).sum::<Vec3A>() / cell.points.len() as f32;
        let of_link = |&(cell, weight): &(u32, Vec3)| {
            let CellLight { direct, indirect, .. } = light[cell as usize];
            luminance(weight * (direct + indirect))
        };
        let with_radiance = |end: &'a LinkEnd| {
            let links = &row.links[end.links.start as usize..end.links.end as usize];
            (end, (end.source + links.iter().map(of_link).sum::<f32>()) / end.share)
        };
        let ends: Vec<(&LinkEnd, f32)> = row.ends.iter().map(with_radiance).collect();
        let of_end = |&(end, radiance): &(&LinkEnd, f32)| {
            let (share, light) = (end.share, end.share * radiance);
            Sums { share, light, light_sq: light * radiance, squares: light * light }
        };
        let sums = Sums::sum(ends.iter().map(of_end));
        Self { centre, ends, sums }
    }
}

impl Sums {
    fn of(members: &[Member<'_>]) -> Self {
        Self::sum(members.iter().map(|member| member.sums))
    }

    fn sum(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |a, b| Self {
            share: a.share + b.share,
            light: a.light + b.light,
            light_sq: a.light_sq + b.light_sq,
            squares: a.squares + b.squares,
        })
    }

    /// The number of links that would bring as much light with as much noise if all were equally bright; 0 in the dark.
    fn hits(&self) -> f32 {
        if self.squares > 0.0 { self.light * self.light / self.squares } else { 0.0 }
    }

    /// The share of the hemispheres that would bring the light if all of it were equally bright; 1 in the dark.
    fn lit_share(&self) -> f32 {
        let squares = self.light_sq * self.share;
        if squares > 0.0 { self.light * self.light / squares } else { 1.0 }
    }
}

/// The root mean square of the radiance in each of `n x n` texels of what a point sees in `frame`, as its glints tell
/// it, relative to the mean of all. Glints count for the texels around them, too: what rays met once in them lies beside
/// them as well.
pub(crate) fn brightness(glints: &[Glint], p: Vec3A, frame: &Frame, n: usize) -> Vec<f32> {
    let mut squares = vec![0.0; n * n];
    for glint in glints {
        let way = if glint.is_far { glint.at } else { glint.at - p };
        let across = if glint.is_far { 1.0 } else { way.length_squared() };
        let wi = frame.to_local(way.normalize_or(frame.n));
        if wi.z > 0.0 && across > 0.0 {
            let square = (glint.weight * wi.z / (std::f32::consts::PI * across)).min(BRIGHTEST);
            add_around(&mut squares, n, hemimap::cosine_hemisphere_to_square(wi), square);
        }
    }
    blur(&mut squares, n);
    squares.into_iter().map(|square| (square * (n * n) as f32).sqrt()).collect()
}

/// Adds a number to the texels around a place of the square, as a bilinear look-up weighs them.
fn add_around(texels: &mut [f32], n: usize, place: Vec2, number: f32) {
    let place = place * n as f32 - 0.5;
    let (first, far) = (place.floor(), place.fract_gl());
    let near = 1.0 - far;
    let last = IVec2::splat(i32::try_from(n).expect("at most 64") - 1);
    for (x, y, weight) in
        [(0, 0, near.x * near.y), (1, 0, far.x * near.y), (0, 1, near.x * far.y), (1, 1, far.x * far.y)]
    {
        let texel = (first.as_ivec2() + IVec2::new(x, y)).clamp(IVec2::ZERO, last).as_uvec2();
        texels[texel.y as usize * n + texel.x as usize] += weight * number;
    }
}

/// Spreads what rows of `n` texels hold over three by three of them; what would leave the square stays at its border.
fn blur(texels: &mut [f32], n: usize) {
    let of_three = |before: f32, at: f32, after: f32| 0.25 * (before + after) + 0.5 * at;
    let mut columns = texels.to_vec();
    for row in 0..n {
        let [before, at, after] = [row.saturating_sub(1), row, (row + 1).min(n - 1)].map(|row| &texels[row * n..][..n]);
        for (blurred, ((before, at), after)) in zip(&mut columns[row * n..], zip(zip(before, at), after)) {
            *blurred = of_three(*before, *at, *after);
        }
    }
    for (row, blurred) in zip(columns.chunks_exact(n), texels.chunks_exact_mut(n)) {
        for (column, blurred) in blurred.iter_mut().enumerate() {
            *blurred = of_three(row[column.saturating_sub(1)], row[column], row[(column + 1).min(n - 1)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glints_are_seen_where_they_are() {
        const N: usize = 16;
        let p = Vec3A::new(1.0, 2.0, 3.0);
        let frame = Frame::from_normal(Vec3A::new(0.0, 0.6, 0.8));
        for u in [Vec2::new(0.3, 0.6), Vec2::new(0.71, 0.22), Vec2::new(0.01, 0.99)] {
            let local = hemimap::square_to_cosine_hemisphere(u);
            let wi = frame.to_world(local);
            // A tenth of the hemisphere, three times as bright as the mean.
            let solid_angle = 0.1 * std::f32::consts::PI / local.z;
            let far = Glint { at: wi, is_far: true, weight: 9.0 * solid_angle };
            let near = Glint { at: p + 5.0 * wi, is_far: false, weight: 9.0 * solid_angle * 25.0 };
            let below = Glint { at: p - frame.n, is_far: false, weight: 1e6 };
            let [of_far, of_near] = [far, near].map(|glint| brightness(&[glint, below], p, &frame, N));
            let mean_sq = of_far.iter().map(|b| b * b).sum::<f32>() / (N * N) as f32;
            assert!((mean_sq - 0.9).abs() < 1e-4, "the mean of the squares is {mean_sq}");
            assert!(zip(&of_far, &of_near).all(|(a, b)| (a - b).abs() < 1e-3 * (1.0 + a)), "{u}: near and far differ");
            let brightest = (0..N * N).max_by(|&a, &b| of_far[a].total_cmp(&of_far[b])).unwrap();
            let middle = (Vec2::new((brightest % N) as f32, (brightest / N) as f32) + 0.5) / N as f32;
            assert!((middle - u).abs().max_element() <= 1.0 / N as f32, "{middle} instead of {u}");
        }
        let at_itself = Glint { at: p, is_far: false, weight: 1.0 };
        assert_eq!(brightness(&[at_itself], p, &frame, N), vec![0.0; N * N]);
    }
}
