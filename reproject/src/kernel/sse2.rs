//! Lanes of 128 bits, which every processor of this architecture has: SSE2 on x86-64, so that nothing has to be enabled
//! or asked.

use super::board::{Board, Task, Word};
use crate::Masks;

/// One reprojection.
pub(super) fn project<W: Word>(task: &Task<'_>, masks: &mut Masks, board: &mut Board<W>) -> [f32; 7] {
    super::wide(task, masks, board)
}
