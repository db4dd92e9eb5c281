//! Lanes of 512 bits.

use super::board::{Board, Task, Word};
use crate::Masks;

/// Whether the processor has what [`project`] is compiled for.
pub(super) fn is_supported() -> bool {
    super::avx2::is_supported()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

/// One reprojection.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn project<W: Word>(task: &Task<'_>, masks: &mut Masks, board: &mut Board<W>) -> [f32; 7] {
    super::wide(task, masks, board)
}
