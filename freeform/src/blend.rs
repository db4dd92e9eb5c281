//! A ray through a blend of free forms: no polynomial, so that roots are isolated by interval arithmetic.
//!
//! On a stretch of the ray the function has a range of values and its derivative one of slopes, both rounded outwards.
//! Where the values do not include zero there is no root; where the slopes do not, the signs at the ends tell whether
//! there is one; else the stretch is halved, until it is as short as rounding. No step size and no tolerance decide:
//! what is settled is settled as exact arithmetic would.
//!
//! Quadratics are taken about the middle of the stretch, q(m) + q'(m) h + a h^2, and the whole once more by its mean
//! value, f(m) + f' h: both errors shrink with the square of the length.
//!
//! On most stretches most parts say nothing, and are not asked again (see `evaluation`); and most of space is far from
//! the surface, and is crossed at once (see `cells`). A plate with a hundred holes costs what the few at hand do.
//!
//! # Source
//! Moore 1966, Interval analysis. Kalra and Barr 1989, Guaranteed ray intersections with implicit surfaces, with
//! derivatives in place of rate bounds.

use std::ops::ControlFlow;

use crate::{
    Crossing, FreeForm, Ray, Solid,
    along::{Along, seen_from},
    bounds::Extent,
    cells::{Cell, Cells},
    evaluation::{Compared, Evaluation, Silent},
    polish::polish,
    psi::Slope,
    range::{Range, RangeSlope},
    trace::{Local, Walked, Walker},
    tree::{Place, Token, form_tokens},
};

/// Halvings before a stretch counts as a point: more than the 53 bits of a number, and some to come down from
/// `ENDLESS`.
const DEPTH_MAX: u32 = 100;
/// Stretches that a ray may be cut into: a guard. Few take more than a handful, one that touches the surface 200.
const STRETCHES_MAX: u32 = 20_000;
/// A stretch of fewer rounding steps is not halved further.
const SHORTEST: f64 = 4.0 * f64::EPSILON;
/// Nor is one on which the values range no farther than so many times what rounding leaves open of single values.
const HIDDEN: f64 = 2.0;
/// A blend without bounds is followed for so many times the distance of the ray from its first form, and so many
/// metres.
const ENDLESS: f64 = 1e12;
/// The start of a ray is on the surface if its value is this many times what rounding of the start and of the value can
/// make.
const START_ROUNDING: f64 = 8.0;

/// A form along the ray, with those of its perturbations that may act.
struct Leaf {
    base: Along,
    bumps: Vec<(Along, f64)>,
}

/// The function of a blend along a ray.
struct Function<'a> {
    tokens: &'a [Token],
    /// For each token that is a form and was asked for.
    leaves: Vec<Option<Leaf>>,
}

/// Shows each crossing of the ray with the blend at `place` to `visit`, in order, until that breaks off. The ray is cut
/// to the extent.
pub(crate) fn walk(
    solid: &Solid,
    place: Place,
    (extent, cells): (&Extent, &Cells),
    ray: &Ray,
    visit: impl FnMut(Crossing) -> ControlFlow<()>,
) -> Walked {
    let home = solid.forms[place.form].origin();
    let Some(local) = Local::within(&extent.moved(-home), home, ray) else {
        return Walked { starts_inside: false, ends_inside: false };
    };
    let endless = endless(&local);
    let (lo, hi) = (local.lo.max(-endless), local.hi.min(endless));
    let tokens = &solid.tokens[place.token..][..cells.token_count()];
    let mut walker = Walker::new(&local, visit);
    let mut isolation = Isolation {
        solid,
        place,
        ray,
        local: &local,
        ends: (lo, hi),
        function: Function { tokens, leaves: Vec::new() },
        silent: Silent::none(tokens.len()),
        start: None,
        stretches: 0,
    };
    let (_, error) = seen_from(home, ray, local.t0);
    // The walker itself knows whether it was broken off.
    let _ = if cells.hold(error.max_element().max(local.start_error.unwrap_or(0.0))) {
        isolation.run(cells, &mut walker)
    } else {
        isolation.run_without_cells(&mut walker)
    };
    walker.finish(local.start_error.is_some())
}

/// Returns where an endless ray through a blend without bounds is given up; finite ends are kept.
fn endless(local: &Local) -> f64 {
    let ends = [local.lo, local.hi].map(|s| if s.is_finite() { s.abs() } else { 0.0 });
    // A ray through the home of the blend has no distance from it but rounding.
    let far = ENDLESS * local.unit().max(local.d.length().recip());
    far.max(ends[0]).max(ends[1])
}

impl Leaf {
    fn new(form: &FreeForm, ray: &Ray, local: &Local, (lo, hi): (f64, f64)) -> Self {
        let (m, radius) = (0.5 * (lo + hi), half(lo, hi));
        let (p, error) = seen_from(form.origin(), ray, local.t0);
        let mut bumps = Vec::new();
        form.near_ray(p, ray.direction, lo, hi, |index| {
            let perturbation = &form.perturbations()[index as usize];
            let along = Along::new(&perturbation.quadric, p, error, ray.direction);
            if perturbation.factor != 0.0 && along.about(m, radius).value.sign() >= 0.0 {
                bumps.push((along, perturbation.factor));
            }
        });
        Self { base: Along::new(form.base(), p, error, ray.direction), bumps }
    }
}

impl Function<'_> {
    /// Returns the values and slopes within `radius` of `m`; parts that say nothing there are added to the silent ones,
    /// unless it is one point alone.
    fn about(&self, m: f64, radius: f64, silent: &mut Silent) -> RangeSlope {
        self.evaluate(silent, radius > 0.0, |leaf| {
            let mut sum = leaf.base.about(m, radius);
            for (along, factor) in &leaf.bumps {
                let RangeSlope { value, slope } = along.about(m, radius);
                let (q, factor) = (value.positive_part(), Range::exactly(*factor));
                let square = q.square();
                sum.value = sum.value + factor * (square * q);
                sum.slope = sum.slope + Range::exactly(3.0) * factor * (square * slope);
            }
            sum
        })
    }

    /// Returns value and slope at `s`, rounded.
    fn at(&self, s: f64, silent: &mut Silent) -> Slope {
        self.evaluate(silent, false, |leaf| {
            let mut sum = leaf.base.at(s);
            for (along, factor) in &leaf.bumps {
                let Slope { value, slope } = along.at(s);
                let q = value.max(0.0);
                sum.value += factor * (q * q * q);
                sum.slope += 3.0 * factor * (q * q) * slope;
            }
            sum
        })
    }

    fn evaluate<V: Compared>(&self, silent: &mut Silent, marks: bool, leaf: impl Fn(&Leaf) -> V) -> V {
        let leaf = |token: usize| leaf(self.leaves[token].as_ref().expect("leaves are made before they are asked"));
        Evaluation { tokens: self.tokens, silent, marks, leaf }.whole()
    }
}

/// The search for the roots along one ray.
struct Isolation<'a> {
    solid: &'a Solid,
    place: Place,
    ray: &'a Ray,
    local: &'a Local,
    /// Ends of the ray in the box of the blend.
    ends: (f64, f64),
    function: Function<'a>,
    silent: Silent,
    /// The start, where it is on the surface: nothing is asked of its sign.
    start: Option<f64>,
    stretches: u32,
}

impl Isolation<'_> {
    /// Walks the ray through the cells.
    fn run<V: FnMut(Crossing) -> ControlFlow<()>>(&mut self, cells: &Cells, walker: &mut Walker<V>) -> ControlFlow<()> {
        let (lo, hi) = self.ends;
        let mut from = lo;
        if let Some(error) = self.local.start_error
            && let Cell::Surface { silent } = cells.at(self.local.p + lo * self.local.d)
        {
            self.silent.reset(cells.silent(silent));
            self.make_leaves();
            if let Some(reach) = self.reach_of_surface(error) {
                // Whatever borders lie between the start and the root that it stands for, they are passed in one piece.
                self.start = Some(lo);
                from = (lo + reach).min(hi);
                if !cells.hold(reach * self.local.d.abs().max_element()) {
                    self.silent = Silent::none(self.function.tokens.len());
                    self.make_leaves();
                }
                self.isolate((lo, from), 0, walker)?;
            }
        }
        if from < hi { self.cells(cells, 0, (from, hi), walker) } else { ControlFlow::Continue(()) }
    }

    /// Walks the ray with all parts.
    fn run_without_cells<V: FnMut(Crossing) -> ControlFlow<()>>(&mut self, walker: &mut Walker<V>) -> ControlFlow<()> {
        self.make_leaves();
        if let Some(error) = self.local.start_error {
            self.start = self.reach_of_surface(error).map(|_| self.ends.0);
        }
        self.isolate(self.ends, 0, walker)
    }

    /// Walks the part of the ray in a cell.
    fn cells<V: FnMut(Crossing) -> ControlFlow<()>>(
        &mut self,
        cells: &Cells,
        cell: u32,
        (lo, hi): (f64, f64),
        walker: &mut Walker<V>,
    ) -> ControlFlow<()> {
        let (axis, at, upper) = match cells.cell(cell) {
            Cell::Side { inside } => return walker.stretch(lo, hi, inside),
            Cell::Surface { silent } => {
                self.silent.reset(cells.silent(silent));
                self.make_leaves();
                return self.isolate((lo, hi), 0, walker);
            }
            Cell::Halved { axis, at, upper } => (usize::from(axis), at, upper),
        };
        let (p, d) = (self.local.p[axis], self.local.d[axis]);
        let goes_up = d > 0.0 || (d == 0.0 && p < at);
        let (first, second) = if goes_up { (cell + 1, upper) } else { (upper, cell + 1) };
        let s = (at - p) / d;
        if d == 0.0 || s >= hi {
            self.cells(cells, first, (lo, hi), walker)
        } else if s <= lo {
            self.cells(cells, second, (lo, hi), walker)
        } else {
            self.cells(cells, first, (lo, s), walker)?;
            self.cells(cells, second, (s, hi), walker)
        }
    }

    /// Makes the leaves that are not silent.
    fn make_leaves(&mut self) {
        let Function { tokens, leaves } = &mut self.function;
        leaves.resize_with(tokens.len(), || None);
        let forms = &self.solid.forms[self.place.form..];
        for (token, form) in form_tokens(tokens).zip(forms) {
            if leaves[token].is_none() && !self.silent.holds(token) {
                leaves[token] = Some(Leaf::new(form, self.ray, self.local, self.ends));
            }
        }
    }

    /// Returns how far beyond the start the root lies that it stands for, if the start is on the surface but for
    /// rounding.
    fn reach_of_surface(&mut self, point_error: f64) -> Option<f64> {
        let start = self.solid.local_linear(self.ray.at(self.ray.t_min), self.place);
        let Range { lo, hi } = self.function.about(self.ends.0, 0.0, &mut self.silent).value;
        let noise = START_ROUNDING * (hi - lo) + point_error * start.gradient.length();
        let slope = start.gradient.dot(self.local.d).abs();
        (lo <= noise && hi >= -noise).then_some(2.0 * noise / slope)
    }

    /// Isolates the roots of a part of the stretch at hand.
    fn isolate_part<V: FnMut(Crossing) -> ControlFlow<()>>(
        &mut self,
        part: (f64, f64),
        depth: u32,
        walker: &mut Walker<V>,
    ) -> ControlFlow<()> {
        self.silent.push();
        let flow = self.isolate(part, depth, walker);
        self.silent.pop();
        flow
    }

    /// Cuts the stretch until each part has a known number of roots: none or one.
    fn isolate<V: FnMut(Crossing) -> ControlFlow<()>>(
        &mut self,
        (lo, hi): (f64, f64),
        depth: u32,
        walker: &mut Walker<V>,
    ) -> ControlFlow<()> {
        self.stretches += 1;
        let (m, radius) = (0.5 * (lo + hi), half(lo, hi));
        let all = self.function.about(m, radius, &mut self.silent);
        if all.value.sign() != 0.0 {
            return walker.stretch(lo, hi, all.value.sign() > 0.0);
        }
        let middle = self.function.about(m, 0.0, &mut self.silent).value;
        let mean = middle + all.slope * Range::about_zero(radius);
        if mean.sign() != 0.0 {
            return walker.stretch(lo, hi, mean.sign() > 0.0);
        }
        if all.slope.sign() != 0.0 {
            let (start, function, silent) = (self.start, &self.function, &mut self.silent);
            let mut sign = |s: f64| if start == Some(s) { 0.0 } else { function.about(s, 0.0, silent).value.sign() };
            return match (sign(lo), sign(hi)) {
                // Both ends are in the surface but for rounding: the walker keeps the last side.
                (0.0, 0.0) => ControlFlow::Continue(()),
                // An end whose sign rounding hides is the root; the slope says that there is no other.
                (0.0, side) | (side, 0.0) => walker.stretch(lo, hi, side > 0.0),
                (before, after) if before == after => walker.stretch(lo, hi, before > 0.0),
                (before, _) => {
                    let value_and_slope = |s: f64| {
                        let Slope { value, slope } = self.function.at(s, &mut self.silent);
                        (value, slope)
                    };
                    let inside = before > 0.0;
                    let root = polish((lo, m, hi), inside, f64::EPSILON * self.local.unit(), value_and_slope);
                    walker.root((lo, root, hi), inside)
                }
            };
        }
        // Halves would show no more where the rounding of one value hides as much. It grows along the ray: what it
        // hides in the middle may show at an end.
        let is_hidden = middle.sign() == 0.0 && mean.width() <= HIDDEN * middle.width() && {
            let mut noise = |s: f64| self.function.about(s, 0.0, &mut self.silent).value.width();
            mean.width() <= HIDDEN * noise(lo).min(noise(hi))
        };
        let is_short = depth == DEPTH_MAX || hi - lo <= SHORTEST * (m.abs() + self.local.unit());
        if is_hidden || is_short || self.stretches > STRETCHES_MAX {
            return match self.function.about(hi, 0.0, &mut self.silent).value.sign() {
                0.0 => ControlFlow::Continue(()),
                side => walker.stretch(hi, hi, side > 0.0),
            };
        }
        self.isolate_part((lo, m), depth + 1, walker)?;
        self.isolate_part((m, hi), depth + 1, walker)
    }
}

/// Returns how far the ends are from the middle, rounded up.
fn half(lo: f64, hi: f64) -> f64 {
    let m = 0.5 * (lo + hi);
    (m - lo).max(hi - m).next_up()
}
