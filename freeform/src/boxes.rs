//! A tree of boxes: which of many things a ray or a point may meet.

use glam::DVec3;

use crate::bounds::Extent;

/// A box of the tree. Its left child follows it; a leaf holds `count` things from `first`.
#[derive(Debug, Clone, Copy)]
struct Node {
    extent: Extent,
    /// First thing of a leaf, or the right child.
    first: u32,
    /// Things of a leaf; 0 in an inner node.
    count: u32,
}

/// Boxes by index, those without a finite size apart.
#[derive(Debug, Clone, Default)]
pub(crate) struct Boxes {
    nodes: Vec<Node>,
    /// Things with a finite box, in the order of the leaves.
    order: Vec<u32>,
    extents: Vec<Extent>,
    /// Things whose box is infinite along some axis.
    endless: Vec<u32>,
}

/// A leaf holds as many things at most; fewer cost more boxes than tests.
const LEAF: usize = 2;
/// Depth of a tree of 2^32 things that is halved at each level, and to spare.
const STACK: usize = 40;

impl Boxes {
    /// Builds the tree; empty boxes are left out, for nothing meets them.
    pub(crate) fn new(extents: Vec<Extent>) -> Self {
        let numbered = || (0_u32..).zip(&extents).filter(|(_, extent)| !extent.is_empty());
        let mut order: Vec<u32> = numbered().filter(|(_, e)| e.is_finite()).map(|(i, _)| i).collect();
        let endless = numbered().filter(|(_, e)| !e.is_finite()).map(|(i, _)| i).collect();
        let mut nodes = Vec::new();
        if !order.is_empty() {
            split(&extents, &mut order, 0, &mut nodes);
        }
        Self { nodes, order, extents, endless }
    }

    /// Returns the box of a thing.
    pub(crate) fn extent(&self, index: u32) -> &Extent {
        &self.extents[index as usize]
    }

    /// Returns the memory held, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
            + size_of_val(&self.order[..])
            + size_of_val(&self.extents[..])
            + size_of_val(&self.endless[..])
    }

    /// Shows the things whose box `o + t d`, `t_min <= t <= t_max`, meets, with where it enters the box, in no
    /// particular order.
    pub(crate) fn along(&self, o: DVec3, d: DVec3, t_min: f64, t_max: f64, mut visit: impl FnMut(u32, f64)) {
        self.descend(|extent| extent.clip(o, d, t_min, t_max).map(|(near, _)| near), &mut visit);
    }

    /// Shows the things whose box holds the point.
    pub(crate) fn around(&self, p: DVec3, mut visit: impl FnMut(u32)) {
        self.descend(|extent| extent.holds(p).then_some(()), &mut |index, ()| visit(index));
    }

    fn descend<T>(&self, meets: impl Fn(&Extent) -> Option<T>, visit: &mut impl FnMut(u32, T)) {
        let mut test = |index: u32| {
            if let Some(found) = meets(&self.extents[index as usize]) {
                visit(index, found);
            }
        };
        self.endless.iter().for_each(|&index| test(index));
        if self.nodes.is_empty() {
            return;
        }
        let (mut stack, mut height, mut at) = ([0_u32; STACK], 0, 0_u32);
        loop {
            let node = &self.nodes[at as usize];
            let open = meets(&node.extent).is_some();
            if open && node.count == 0 {
                stack[height] = node.first;
                height += 1;
                at += 1;
                continue;
            }
            if open {
                let leaf = node.first as usize..(node.first + node.count) as usize;
                self.order[leaf].iter().for_each(|&index| test(index));
            }
            if height == 0 {
                return;
            }
            height -= 1;
            at = stack[height];
        }
    }
}

/// Halves the things by the middles of their boxes until few are left; `start` is the place of `order` in the whole.
fn split(extents: &[Extent], order: &mut [u32], start: usize, nodes: &mut Vec<Node>) {
    let extent_of = |i: &u32| &extents[*i as usize];
    let extent = order.iter().map(extent_of).fold(Extent::EMPTY, |sum, e| sum.union(e));
    let index = nodes.len();
    let number = |n: usize| u32::try_from(n).expect("things are numbered in 32 bits");
    nodes.push(Node { extent, first: number(start), count: number(order.len()) });
    if order.len() <= LEAF {
        return;
    }
    let middle = |i: &u32| extent_of(i).min + extent_of(i).max;
    let (low, high) = order
        .iter()
        .map(middle)
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), m| (low.min(m), high.max(m)));
    let axis = (high - low).max_position();
    let half = order.len() / 2;
    // The index settles ties, so that the tree does not depend on the way of sorting.
    order.select_nth_unstable_by(half, |a, b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.cmp(b)));
    let (left, right) = order.split_at_mut(half);
    split(extents, left, start, nodes);
    nodes[index] = Node { extent, first: number(nodes.len()), count: 0 };
    split(extents, right, start + half, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_finds_what_a_list_finds() {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        let mut extents: Vec<Extent> = (0..500)
            .map(|k| {
                let middle = 3.0 * DVec3::new(next(), next(), next());
                let half = DVec3::splat(0.1 + f64::from(k % 7) * 0.05);
                Extent { min: middle - half, max: middle + half }
            })
            .collect();
        extents[17] = Extent::EMPTY;
        extents[99].max.y = f64::INFINITY;
        // Many in one place.
        for k in 200..260 {
            extents[k] = extents[200];
        }
        let boxes = Boxes::new(extents.clone());
        let mut met = 0;
        for k in 0..200 {
            let (o, d) = (3.0 * DVec3::new(next(), -1.0, next()), DVec3::new(next(), 1.0, next()));
            let (mut found, mut expected) = (Vec::new(), Vec::new());
            boxes.along(o, d, 0.0, 8.0, |index, near| found.push((index, near.to_bits())));
            for (index, extent) in (0_u32..).zip(&extents).filter(|(_, e)| !e.is_empty()) {
                expected.extend(extent.clip(o, d, 0.0, 8.0).map(|(near, _)| (index, near.to_bits())));
            }
            found.sort_unstable();
            assert_eq!(found, expected, "ray {k}");
            met += found.len();
            let (mut found, p) = (Vec::new(), o + 2.0 * d);
            boxes.around(p, |index| found.push(index));
            found.sort_unstable();
            let expected: Vec<u32> = (0_u32..).zip(&extents).filter(|(_, e)| e.holds(p)).map(|(i, _)| i).collect();
            assert_eq!(found, expected, "point {k}");
        }
        assert!(met > 300, "rays meet {met} boxes");
    }
}
