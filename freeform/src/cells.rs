//! Where a blend has its surface: its box cut into cells, each inside, outside, or on the surface with the few parts
//! that have a say there.
//!
//! A cell is found in ranges, as a stretch of a ray is: what the values over its box, rounded outwards, do not decide
//! is halved along its longest side. A ray crosses the cells inside and outside without a look at the function.
//!
//! # Source
//! Duff 1992, Interval arithmetic and recursive subdivision for implicit functions and constructive solid geometry.

use glam::DVec3;

use crate::{
    FreeForm,
    bounds::Extent,
    evaluation::{Evaluation, Silent},
    range::Range,
    tree::{Token, form_tokens},
};

/// Times that the box is halved: 2048 cells for 8 forms or more, half as many for each halving of that, for fewer forms
/// gain less by them.
const LEVELS: u32 = 11;
const LEVELS_OF_ONE: u32 = 8;
/// Cells are known to be what they are this share of the box beyond their faces, where rounding may put a ray.
const MARGIN: f64 = 1e-9;

/// A cell.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Cell {
    /// It has two halves: the lower one follows, the upper one stands elsewhere.
    Halved { axis: u8, at: f64, upper: u32 },
    /// The surface does not reach it.
    Side { inside: bool },
    /// It may hold a part of the surface; the number of the set of parts that say nothing.
    Surface { silent: u32 },
}

/// See the head of the file.
#[derive(Debug, Clone)]
pub(crate) struct Cells {
    cells: Vec<Cell>,
    /// Sets of tokens, one after the other.
    silent: Vec<u64>,
    tokens: usize,
    /// See `MARGIN`, in the units of the box.
    margin: f64,
}

impl Cells {
    /// Cuts the box of a blend; one without end stays one cell.
    pub(crate) fn new(tokens: &[Token], forms: &[FreeForm], extent: &Extent) -> Self {
        let home = forms[0].origin();
        let extent = extent.moved(-home);
        let mut cells = Self { cells: Vec::new(), silent: Vec::new(), tokens: tokens.len(), margin: 0.0 };
        if extent.is_finite() {
            cells.margin = MARGIN * (extent.max - extent.min).max_element();
            let levels = LEVELS.min(LEVELS_OF_ONE + forms.len().ilog2());
            let mut form_at = vec![None; tokens.len()];
            form_tokens(tokens).zip(forms).for_each(|(token, form)| form_at[token] = Some(form));
            let mut cutter = Cutter { tokens, form_at, home, levels, silent: Silent::none(tokens.len()), cells };
            cutter.cut(&extent, 0);
            cells = cutter.cells;
            cells.cells.shrink_to_fit();
            cells.silent.shrink_to_fit();
        } else {
            cells.silent = vec![0; tokens.len().div_ceil(64)];
            cells.cells.push(Cell::Surface { silent: 0 });
        }
        cells
    }

    /// Returns a cell; the first is the whole.
    pub(crate) fn cell(&self, index: u32) -> Cell {
        self.cells[index as usize]
    }

    /// Returns the cell without halves at a place, relative to the origin of the first form.
    pub(crate) fn at(&self, p: DVec3) -> Cell {
        let mut index = 0;
        loop {
            match self.cell(index) {
                Cell::Halved { axis, at, upper } => {
                    index = if p[usize::from(axis)] < at { index + 1 } else { upper };
                }
                cell => return cell,
            }
        }
    }

    /// Returns a set of tokens that say nothing; with an operation, all within it.
    pub(crate) fn silent(&self, set: u32) -> &[u64] {
        let words = self.tokens.div_ceil(64);
        &self.silent[set as usize * words..][..words]
    }

    /// Returns the number of tokens of the blend.
    pub(crate) fn token_count(&self) -> usize {
        self.tokens
    }

    /// Whether cells hold for places that may be off by `error` along each axis.
    pub(crate) fn hold(&self, error: f64) -> bool {
        4.0 * error < self.margin
    }

    /// Returns the memory held on the heap, bytes.
    pub(crate) fn heap_bytes(&self) -> usize {
        size_of_val(&self.cells[..]) + size_of_val(&self.silent[..])
    }
}

/// Cuts cells; it calls itself once a level.
struct Cutter<'a> {
    tokens: &'a [Token],
    /// For each token that is a form, that form.
    form_at: Vec<Option<&'a FreeForm>>,
    home: DVec3,
    levels: u32,
    silent: Silent,
    cells: Cells,
}

impl Cutter<'_> {
    fn cut(&mut self, extent: &Extent, level: u32) {
        self.silent.push();
        let index = self.cells.cells.len();
        let value = self.value(extent);
        if value.sign() != 0.0 {
            self.cells.cells.push(Cell::Side { inside: value.sign() > 0.0 });
        } else if level == self.levels {
            let silent = self.number_of_silent();
            self.cells.cells.push(Cell::Surface { silent });
        } else {
            let axis = (extent.max - extent.min).max_position();
            let at = 0.5 * (extent.min[axis] + extent.max[axis]);
            let (mut lower, mut upper) = (*extent, *extent);
            (lower.max[axis], upper.min[axis]) = (at, at);
            self.cells.cells.push(Cell::Side { inside: false });
            self.cut(&lower, level + 1);
            let second = self.cells.cells.len();
            self.cut(&upper, level + 1);
            let axis = u8::try_from(axis).expect("one of three");
            let upper = u32::try_from(second).expect("there are few cells");
            self.cells.cells[index] = Cell::Halved { axis, at, upper };
        }
        self.silent.pop();
    }

    /// Returns the values over a box and its margin.
    fn value(&mut self, extent: &Extent) -> Range {
        let middle = 0.5 * (extent.min + extent.max);
        let half = 0.5 * (extent.max - extent.min) + self.cells.margin;
        let (form_at, home) = (&self.form_at, self.home);
        let leaf = |token: usize| {
            let form = form_at[token].expect("a form");
            let apart = home - form.origin();
            let p = middle + apart;
            let h = half + f64::EPSILON * (middle.abs() + home.abs() + form.origin().abs() + p.abs());
            let bump = |sum: Range, perturbation: &crate::Perturbation| {
                let q = perturbation.quadric.over_box(p, h).positive_part();
                sum + Range::exactly(perturbation.factor) * (q.square() * q)
            };
            form.perturbations().iter().fold(form.base().over_box(p, h), bump)
        };
        Evaluation { tokens: self.tokens, silent: &mut self.silent, marks: true, leaf }.whole()
    }

    /// Returns the number of the set of silent tokens at hand, with all that is within them.
    fn number_of_silent(&mut self) -> u32 {
        self.silent.push();
        for (token, kind) in self.tokens.iter().enumerate() {
            if let Token::Join(join) = kind
                && self.silent.holds(token)
            {
                (token + 1..=token + join.length as usize).for_each(|within| self.silent.add(within));
            }
        }
        let sets = &mut self.cells.silent;
        let set = self.silent.top();
        let known = sets.chunks_exact(set.len()).position(|other| other == set);
        let number = known.unwrap_or_else(|| {
            sets.extend_from_slice(set);
            sets.len() / set.len() - 1
        });
        self.silent.pop();
        u32::try_from(number).expect("there are few cells")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Psi, Quadric, Solid};

    fn ball(centre: DVec3, radius: f64) -> Solid {
        FreeForm::with_origin(centre, Quadric::sphere(DVec3::ZERO, radius).unwrap(), Vec::new()).unwrap().into()
    }

    fn cells_of(solid: &Solid) -> &Cells {
        solid.plan.cells(0, &solid.tokens, &solid.forms).expect("a blend")
    }

    #[test]
    fn cells_are_what_they_say() {
        let balls = |z: f64| (0..6).map(|k| ball(DVec3::new(f64::from(k % 3), f64::from(k / 3), z), 0.6)).collect();
        let sheet = Solid::union(Psi::Blend { width: 0.7 }, balls(0.0)).unwrap();
        let blend = Solid::difference(Psi::Blend { width: 0.3 }, vec![sheet, ball(DVec3::new(1.0, 0.4, 0.5), 0.4)]);
        let solid = blend.unwrap();
        let cells = cells_of(&solid);
        let extent = solid.plan.boxes.extent(0);
        let (mut sides, mut surfaces, mut silent_parts) = ([0, 0], 0, 0);
        for k in 0..20_000_u32 {
            let share = DVec3::new(0.754_877, 0.569_84, 0.327_78) * f64::from(k);
            let p = extent.min + (extent.max - extent.min) * share.fract();
            let at_home = p - solid.forms[0].origin();
            let value = solid.value(p);
            let silent = match cells.at(at_home) {
                Cell::Side { inside } => {
                    sides[usize::from(inside)] += 1;
                    assert_eq!(value > 0.0, inside, "{value} at {p}");
                    continue;
                }
                Cell::Surface { silent } => cells.silent(silent),
                Cell::Halved { .. } => unreachable!("it has no halves"),
            };
            let mut set = Silent::none(solid.tokens.len());
            set.reset(silent);
            silent_parts += set.top()[0].count_ones();
            let exact = |token: usize| {
                let form = form_tokens(&solid.tokens).position(|other| other == token).expect("a form");
                Range::exactly(solid.forms[form].value(p))
            };
            let range =
                Evaluation { tokens: &solid.tokens, silent: &mut set, marks: false, leaf: exact }.whole::<Range>();
            assert!(range.lo <= value && value <= range.hi, "{value} in {range:?} without the silent parts");
            assert!(range.hi - range.lo < 1e-14, "{range:?} is one number");
            surfaces += 1;
        }
        assert!(sides[0] > 2000 && sides[1] > 500, "most of the box is decided: {sides:?}");
        assert!(silent_parts > 4 * surfaces, "and few parts have a say in the rest: {silent_parts} of {surfaces}");
    }

    #[test]
    fn a_box_without_end_is_one_cell() {
        let slab =
            || FreeForm::new(Quadric::new([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]).unwrap(), Vec::new());
        let parts = vec![slab().unwrap().into(), slab().unwrap().into()];
        let solid = Solid::union(Psi::Blend { width: 0.5 }, parts).unwrap();
        assert!(matches!(cells_of(&solid).cells[..], [Cell::Surface { silent: 0 }]));
        assert!(!cells_of(&solid).hold(0.0), "and no ray takes it");
    }
}
