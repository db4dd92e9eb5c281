//! An even tree by halving at the median: worse for rays than a clustered one, but never deep.

use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::LANES;

/// Builds a tree in which both halves of each node hold as many boxes, split where their centres are farthest apart.
pub(super) fn split(boxes: &[Aabb]) -> Bvh2 {
    let mut numbers: Vec<u32> = (0u32..).take(boxes.len()).collect();
    let mut nodes = vec![Bvh2Node::default()];
    let mut todo = vec![(0, 0..boxes.len())];
    while let Some((node, range)) = todo.pop() {
        let members = &mut numbers[range.clone()];
        let around = members.iter().map(|&i| boxes[i as usize]).reduce(|a, b| a.union(&b)).unwrap_or(Aabb::INVALID);
        if members.len() <= LANES {
            nodes[node] = Bvh2Node::new(around, index(members.len()), index(range.start));
            continue;
        }
        let centre = |i: u32| 0.5 * boxes[i as usize].min + 0.5 * boxes[i as usize].max;
        let (low, high) = members
            .iter()
            .map(|&i| centre(i))
            .fold((centre(members[0]), centre(members[0])), |(low, high), c| (low.min(c), high.max(c)));
        let axis = (high - low).max_position();
        let half = members.len() / 2;
        members.select_nth_unstable_by(half, |&i, &j| centre(i)[axis].total_cmp(&centre(j)[axis]).then(i.cmp(&j)));
        let middle = range.start + half;
        nodes[node] = Bvh2Node::new(around, 0, index(nodes.len()));
        todo.push((nodes.len(), range.start..middle));
        todo.push((nodes.len() + 1, middle..range.end));
        nodes.extend([Bvh2Node::default(); 2]);
    }
    Bvh2 { nodes, primitive_indices: numbers, ..Bvh2::default() }
}

fn index(i: usize) -> u32 {
    u32::try_from(i).expect("the number of primitives was checked")
}
