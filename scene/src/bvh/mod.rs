//! The acceleration structure over triangles and the boxes of free forms.
//!
//! obvhs builds a binary tree; pairs of its levels are merged to nodes of four children, whose boxes one ray meets at once in
//! four lanes, and each leaf is a packet of up to four primitives, tested in four lanes likewise.

mod build;
mod lane_ray;
mod median;
mod packet;
#[cfg(test)]
mod tests;
mod traverse;

use glam::Vec4;

pub(crate) use build::Primitive;
use packet::Packet;

/// A tree of boxes over primitives.
#[derive(Debug)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    packets: Vec<Packet>,
    /// Entries of the traversal stack that the deepest path can need.
    stack_size: usize,
    /// Whether any packet holds a free form, so that others need not be looked at for one.
    has_forms: bool,
}

/// Four children with their boxes, a lane each. The lanes of absent ones hold an inside-out box, which no ray meets.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Lowest and highest coordinates: `bounds[0][axis]` and `bounds[1][axis]`.
    bounds: [[Vec4; 3]; 2],
    /// Indices of nodes or, in the lanes of `leaves`, of packets.
    children: [u32; 4],
    /// A bit for each lane that holds a packet.
    leaves: u32,
}

impl Bvh {
    /// Returns the memory held, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.packets.capacity() * size_of::<Packet>()
    }
}
