//! Lanes of 256 bits.

use super::board::{Board, Task, Word};
use crate::Masks;

/// Whether the processor has what [`project`] is compiled for.
pub(super) fn is_supported() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

/// One reprojection.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn project<W: Word>(task: &Task<'_>, masks: &mut Masks, board: &mut Board<W>) -> [f32; 7] {
    super::wide(task, masks, board)
}
