//! The kernels of the reprojection. The scalar one is the specification; the others give the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod board;
mod cut;
mod fill;
mod lanes;
mod owners;
mod scalar;
mod sse2;
mod sums;
mod trails;

pub(crate) use board::{Board, Task};
pub(crate) use owners::NOBODY;
pub(crate) use scalar::direction_to_square;
pub use scalar::project_corners;

use board::Word;

use crate::Masks;

/// The instructions that a reprojection uses. All give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// One element after another: the specification of the others.
    Scalar,
    /// Lanes as wide as every processor of this architecture has them: 128 bits on x86-64, where that is SSE2.
    Sse2,
    /// 256 bits.
    Avx2,
    /// 512 bits.
    Avx512,
}

impl Kernel {
    /// All of them, the narrowest first.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Sse2, Self::Avx2, Self::Avx512];

    /// Whether this processor has the instructions.
    #[must_use]
    pub fn is_supported(self) -> bool {
        match self {
            Self::Scalar | Self::Sse2 => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::is_supported(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::is_supported(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Its name in lower case, as in the ids of benchmarks.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Sse2 => "sse2",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The widest that this processor has.
    #[must_use]
    pub fn detect() -> Self {
        Self::ALL.into_iter().rev().find(|kernel| kernel.is_supported()).unwrap_or(Self::Scalar)
    }
}

/// One reprojection onto masks of which some bits may be filled already. Gives sums over elements by their shares:
/// weight, then red, green, blue from a distance, then the same from infinity.
#[expect(unsafe_code, reason = "the one place where a kernel is called")]
pub(crate) fn run<W: Word>(kernel: Kernel, task: &Task<'_>, masks: &mut Masks, board: &mut Board<W>) -> [f32; 7] {
    let project: unsafe fn(&Task<'_>, &mut Masks, &mut Board<W>) -> [f32; 7] = match kernel {
        Kernel::Scalar => scalar::project,
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx2 => avx2::project,
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx512 => avx512::project,
        _ => sse2::project,
    };
    // SAFETY: the kernel is supported: `Workspace` takes no other, which it finds out by `Kernel::is_supported`.
    unsafe { project(task, masks, board) }
}

/// The body of all kernels but the scalar one: it takes the width of the function that it is inlined into.
#[inline(always)]
fn wide<W: Word>(task: &Task<'_>, masks: &mut Masks, board: &mut Board<W>) -> [f32; 7] {
    board.reset(task, masks);
    lanes::draw(task, board);
    fill::fill(task, board);
    board.show(masks);
    sums::sum(task, &board.places)
}
