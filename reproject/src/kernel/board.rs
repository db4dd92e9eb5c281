//! What a reprojection reads, and the board on which a kernel draws.

use std::ops::{BitAnd, BitAndAssign, BitOr, BitOrAssign, BitXor, Not};

use glam::{Mat3A, Vec2, Vec3A};
use radcache::{Elements, LANES, MAX_RESOLUTION};

use crate::{Masks, Settings, Trails};

/// Rows of a polygon that are kept: nearly all elements are lower.
pub(crate) const KEPT: usize = 8;
/// And nearly all of these have no more than so many.
pub(crate) const LOW: usize = 4;
/// Layer masks that elements take in turn: one would wait for what the element before has just written to overlapping
/// rows.
pub(crate) const TURNS: usize = 4;

/// Corners whose cosine is this little below the horizon are on it: rounding of a rotation moves those of the rim so
/// far.
pub(crate) const HORIZON: f32 = 1e-6;

/// One of something for each of 16 polygons.
pub(crate) type Lane<T> = [T; LANES];

/// Rows of a mask, with room for a whole polygon that starts in the last one.
pub(crate) type Mask<W> = [W; MAX_RESOLUTION + KEPT];

/// A row of bits: 32 where the resolution allows, 64 else.
pub(crate) trait Word:
    Copy
    + Default
    + PartialEq
    + Not<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + BitAndAssign
    + BitOrAssign
{
    /// Number of bits.
    const BITS: usize;
    /// Rows in 64 bits, which are counted as fast as 32.
    const ROWS: usize = 64 / Self::BITS;
    /// The rows of 16 polygons, [`KEPT`] of each: words of 64 bits, lane by lane.
    type Drawn: Copy + Default + AsRef<[Lane<u64>]> + AsMut<[Lane<u64>]> + std::fmt::Debug;
    /// The bits from `k` on; `k` is at most [`Self::BITS`].
    fn from_bit(k: u32) -> Self;
    /// Number of bits set.
    fn ones(self) -> u32;
    /// The first bits of a row.
    fn narrow(row: u64) -> Self;
    /// Bit `k` alone.
    fn bit(k: usize) -> Self;
    /// The same bits in a row.
    fn widen(self) -> u64;
    /// [`Self::ROWS`] rows of 16 polygons as words.
    fn pack(rows: &[Lane<Self>; 2]) -> Lane<u64>;
    /// Row number `row` of those that a word holds.
    fn unpack(word: u64, row: usize) -> Self;
    /// Word number `k` of rows.
    fn load(rows: &[Self], k: usize) -> u64;
    /// Adds bits to word number `k` of rows.
    fn add(rows: &mut [Self], k: usize, bits: u64);
}

/// What all words have in common, for they are primitive integers.
macro_rules! single_bits {
    ($word:ty) => {
        const BITS: usize = <$word>::BITS as usize;
        type Drawn = [Lane<u64>; KEPT / <$word as Word>::ROWS];
        #[inline(always)]
        fn from_bit(k: u32) -> Self {
            Self::MAX.unbounded_shl(k)
        }
        #[inline(always)]
        fn bit(k: usize) -> Self {
            1 << k
        }
        #[inline(always)]
        fn ones(self) -> u32 {
            self.count_ones()
        }
    };
}

impl Word for u32 {
    single_bits!(u32);
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "chosen where rows have at most 32 bits")]
    fn narrow(row: u64) -> Self {
        row as Self
    }
    #[inline(always)]
    fn widen(self) -> u64 {
        self.into()
    }
    #[inline(always)]
    fn pack(rows: &[Lane<Self>; 2]) -> Lane<u64> {
        std::array::from_fn(|lane| rows[0][lane].widen() | rows[1][lane].widen() << 32)
    }
    #[inline(always)]
    fn unpack(word: u64, row: usize) -> Self {
        Self::narrow(word >> (32 * row))
    }
    #[inline(always)]
    fn load(rows: &[Self], k: usize) -> u64 {
        rows[2 * k].widen() | rows[2 * k + 1].widen() << 32
    }
    #[inline(always)]
    fn add(rows: &mut [Self], k: usize, bits: u64) {
        let both = Self::load(rows, k) | bits;
        (rows[2 * k], rows[2 * k + 1]) = (Self::unpack(both, 0), Self::unpack(both, 1));
    }
}

impl Word for u64 {
    single_bits!(u64);
    #[inline(always)]
    fn narrow(row: u64) -> Self {
        row
    }
    #[inline(always)]
    fn widen(self) -> u64 {
        self
    }
    #[inline(always)]
    fn pack(rows: &[Lane<Self>; 2]) -> Lane<u64> {
        rows[0]
    }
    #[inline(always)]
    fn unpack(word: u64, _: usize) -> Self {
        word
    }
    #[inline(always)]
    fn load(rows: &[Self], k: usize) -> u64 {
        rows[k]
    }
    #[inline(always)]
    fn add(rows: &mut [Self], k: usize, bits: u64) {
        rows[k] |= bits;
    }
}

/// One reprojection: what goes to where.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Task<'a> {
    pub(crate) elements: &'a Elements,
    /// Record's frame to that of the point.
    pub(crate) rotation: Mat3A,
    /// The point in the record's frame.
    pub(crate) offset: Vec3A,
    pub(crate) n: usize,
    pub(crate) settings: Settings,
}

impl Task<'_> {
    /// Whether the normal of the point is not that of the record.
    #[inline(always)]
    pub(crate) fn is_turned(&self) -> bool {
        self.rotation != Mat3A::IDENTITY
    }

    /// Most trails that there may be: one for each silhouette, or for each element.
    #[inline(always)]
    fn most_trails(&self) -> usize {
        match self.settings.trails {
            Trails::Silhouettes | Trails::Uncovered => self.elements.outline().len(),
            Trails::All => self.elements.len(),
        }
    }

    /// How far what lies behind a silhouette goes along with it.
    #[inline(always)]
    pub(crate) fn behind(&self, share: f32) -> f32 {
        if self.settings.trails == Trails::Uncovered { share } else { 0.0 }
    }

    /// What a silhouette takes of its margin.
    #[inline(always)]
    pub(crate) fn margin(&self, margin: f32) -> f32 {
        if self.settings.margins { margin } else { 0.0 }
    }
}

/// Why an element or a trail takes the slow way, or that it need not; a set of bits.
pub(crate) mod kind {
    /// A corner lies below the horizon, and cut off it leaves more than a quadrilateral.
    pub(crate) const CUT: u8 = 1;
    /// More than [`super::KEPT`] rows.
    pub(crate) const TALL: u8 = 2;
    /// Fills nothing and makes unknown what it covers.
    pub(crate) const HOLLOW: u8 = 4;
    /// More than [`super::LOW`] rows; alone, it is done in lanes too.
    pub(crate) const HIGH: u8 = 8;
    /// Wholly below the horizon: nothing is done.
    pub(crate) const BELOW: u8 = 16;

    /// Whether an element takes the slow way.
    #[inline(always)]
    pub(crate) fn is_slow(kind: u8) -> bool {
        kind & (CUT | TALL | HOLLOW) != 0 && kind & BELOW == 0
    }
}

/// Makes a list at least so long. It never shrinks, for what is added is written first.
fn grow<T: Copy + Default>(list: &mut Vec<T>, len: usize) {
    if list.len() < len {
        list.resize(len, T::default());
    }
}

/// What is known of each element in the square; padded as the elements are.
#[derive(Debug, Default)]
pub(crate) struct Places {
    /// Corner `k` of element `e` has the number `k * padded_len + e`, as in [`Elements`].
    pub(crate) u: Vec<f32>,
    pub(crate) v: Vec<f32>,
    padded: usize,
    /// See [`kind`].
    pub(crate) kind: Vec<u8>,
    /// Area in the square.
    pub(crate) area: Vec<f32>,
    /// First row, at most 64.
    pub(crate) first: Vec<u8>,
    /// Texels covered, and those of them that it takes.
    pub(crate) counts: Vec<[u16; 2]>,
    /// Elements that take the slow way, see [`kind::is_slow`], in order.
    pub(crate) slow: Vec<u16>,
    /// Elements with area that cover no texel's centre, in order.
    pub(crate) small: Vec<u16>,
    /// What leaves a trail, in order: numbers of sides in the outline, or of elements.
    pub(crate) trails: Vec<u16>,
    pub(crate) trail_count: usize,
    /// First row and kind of each of them.
    pub(crate) trail_first: Vec<u8>,
    pub(crate) trail_kind: Vec<u8>,
}

impl Places {
    /// Makes room for so many elements and trails; the contents are left over from before.
    fn grow(&mut self, padded: usize, trails: usize) {
        self.padded = padded;
        grow(&mut self.u, 4 * padded);
        grow(&mut self.v, 4 * padded);
        grow(&mut self.area, padded);
        grow(&mut self.kind, padded);
        grow(&mut self.first, padded);
        grow(&mut self.counts, padded);
        self.slow.clear();
        self.slow.reserve(padded);
        self.small.clear();
        self.small.reserve(padded);
        grow(&mut self.trails, trails);
        grow(&mut self.trail_first, trails);
        grow(&mut self.trail_kind, trails);
    }

    /// Moves the corners of element `e`.
    pub(crate) fn set_quad(&mut self, e: usize, quad: &[Vec2; 4]) {
        for (k, corner) in quad.iter().enumerate() {
            (self.u[k * self.padded + e], self.v[k * self.padded + e]) = (*corner).into();
        }
    }

    /// The corners of element `e`.
    #[inline(always)]
    pub(crate) fn quad(&self, e: usize) -> [Vec2; 4] {
        std::array::from_fn(|k| Vec2::new(self.u[k * self.padded + e], self.v[k * self.padded + e]))
    }
}

/// All rows of an element that took the slow way; none where it fills nothing.
#[derive(Debug)]
pub(crate) struct Special<W> {
    pub(crate) element: u16,
    pub(crate) rows: [W; MAX_RESOLUTION],
}

/// The masks, and the bits of what is drawn on them.
#[derive(Debug)]
pub(crate) struct Grid<W: Word> {
    /// Bits of elements from the first row of each on, unless it is tall or cut.
    pub(crate) drawn: Vec<W::Drawn>,
    /// The same of trails.
    pub(crate) drawn_trails: Vec<W::Drawn>,
    /// What was filled before each layer, and at the end.
    pub(crate) history: Vec<Mask<W>>,
    pub(crate) unknown: Mask<W>,
    /// What is filled or unknown as the layer begins, and the trails of its silhouettes.
    pub(crate) closed: Mask<W>,
    pub(crate) layer_fill: [Mask<W>; TURNS],
    pub(crate) trail: [Mask<W>; TURNS],
    /// Elements that took the slow way, in order.
    pub(crate) special: Vec<Special<W>>,
    /// End of each layer of elements.
    pub(crate) layer_ends: Vec<u16>,
}

impl<W: Word> Default for Grid<W> {
    fn default() -> Self {
        let empty = [W::default(); MAX_RESOLUTION + KEPT];
        Self {
            drawn: Vec::new(),
            drawn_trails: Vec::new(),
            history: Vec::new(),
            unknown: empty,
            closed: empty,
            layer_fill: [empty; TURNS],
            trail: [empty; TURNS],
            special: Vec::new(),
            layer_ends: Vec::new(),
        }
    }
}

/// Word number `k` of polygon number `e`.
#[inline(always)]
pub(crate) fn word<W: Word>(drawn: &[W::Drawn], e: usize, k: usize) -> u64 {
    drawn[e / LANES].as_ref()[k][e % LANES]
}

/// All that a kernel writes.
#[derive(Debug, Default)]
pub(crate) struct Board<W: Word> {
    pub(crate) places: Places,
    pub(crate) grid: Grid<W>,
}

impl<W: Word> Board<W> {
    /// Makes room, and starts from masks whose filled bits are taken by nobody, and whose unknown ones nobody may take.
    #[inline(always)]
    pub(super) fn reset(&mut self, task: &Task<'_>, masks: &Masks) {
        let padded = task.elements.padded_len();
        // The next one is written before it is known whether it is one.
        let trails = (task.most_trails() + 1).next_multiple_of(LANES);
        self.places.grow(padded, trails);
        // Padding covers nothing.
        self.places.counts[task.elements.len()..padded].fill([0; 2]);
        let grid = &mut self.grid;
        grow(&mut grid.drawn, padded / LANES);
        grow(&mut grid.drawn_trails, trails / LANES);
        let empty = [W::default(); MAX_RESOLUTION + KEPT];
        grid.history.resize(task.elements.layer_count() + 1, empty);
        grid.special.clear();
        grid.layer_ends.resize(task.elements.layer_count(), 0);
        (grid.unknown, grid.layer_fill, grid.trail) = (empty, [empty; TURNS], [empty; TURNS]);
        for (j, (&fill, &unknown)) in masks.fill.iter().zip(&masks.unknown).enumerate().take(W::BITS) {
            let (fill, unknown) = (W::narrow(fill), W::narrow(unknown));
            (grid.history[0][j], grid.unknown[j], grid.closed[j]) = (fill, unknown, fill | unknown);
        }
    }

    /// Copies the masks out.
    #[inline(always)]
    pub(super) fn show(&self, masks: &mut Masks) {
        let fill = self.grid.history.last().expect("one more than layers");
        let drawn = fill.iter().zip(&self.grid.unknown).take(W::BITS);
        for ((&fill, &unknown), (fill_row, unknown_row)) in drawn.zip(masks.fill.iter_mut().zip(&mut masks.unknown)) {
            (*fill_row, *unknown_row) = (fill.widen(), unknown.widen());
        }
    }
}
