//! The acceleration structure over triangles and the boxes of free forms.
//!
//! obvhs builds a binary tree; its levels are merged to nodes of eight children, whose boxes one ray meets at once in
//! eight lanes, and each leaf is a packet of up to eight primitives, tested in eight lanes likewise. How wide the
//! lanes' instructions are is chosen at run time; the answers are the same bits.

mod build;
mod clear;
mod lane_ray;
mod median;
mod packet;
#[cfg(test)]
pub(crate) mod tests;
mod traverse;
mod widen;

use fearless_simd::Level;

pub(crate) use build::Primitive;
use packet::Packet;

/// A tree of boxes over primitives.
#[derive(Debug)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    packets: Vec<Packet>,
    /// Instructions that the processor has.
    level: Level,
    /// Whether any packet holds a free form, so that others need not be looked at for one.
    has_forms: bool,
}

/// Children of a node, and primitives of a packet.
const LANES: usize = 8;

/// Eight children with their boxes, a lane each. The lanes of absent ones hold an inside-out box, which no ray meets.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Node {
    /// Lowest and highest coordinates: `bounds[0][axis]` and `bounds[1][axis]`.
    bounds: [[[f32; LANES]; 3]; 2],
    /// Indices of nodes or, in the lanes of `leaves`, of packets.
    children: [u32; LANES],
    /// A bit for each lane that holds a packet.
    leaves: u64,
}

impl Bvh {
    /// Returns the memory held, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.packets.capacity() * size_of::<Packet>()
    }
}
