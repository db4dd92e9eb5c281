//! A ray through a blend of free forms: no polynomial, so that roots are isolated by interval arithmetic.
//!
//! On a stretch of the ray the function has a range of values and its derivative one of slopes, both rounded outwards. Where the values do not include zero there is no
//! root; where the slopes do not, the signs at the ends tell whether there is one; else the stretch is halved, until it is as short as rounding. No step size
//! and no tolerance decide: what is settled is settled as exact arithmetic would.
//!
//! Quadratics are taken about the middle of the stretch, q(m) + q'(m) h + a h^2, and the whole once more by its mean value, f(m) + f' h: both errors
//! shrink with the square of the length.
//!
//! On most stretches most parts say nothing: where one function is above another by the width of the blend, the union is the first, to the last digit, and the
//! other is not asked again within that stretch. A plate with a hundred holes costs what the few at hand do.
//!
//! # Source
//! Moore 1966, Interval analysis. Kalra and Barr 1989, Guaranteed ray intersections with implicit surfaces, with derivatives in place of rate bounds.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::{
    Crossing, Quadric, Ray, Solid,
    polish::polish,
    psi::{Psi, Slope, Valued},
    range::{Range, RangeSlope},
    trace::{Local, Walked, Walker},
    tree::{Join, Operation, Place, Token},
};

/// Halvings before a stretch counts as a point: more than the 53 bits of a number, and some to come down from `ENDLESS`.
const DEPTH_MAX: u32 = 100;
/// Stretches that a ray may be cut into. A transversal root takes about 20, a tangent one 200; a ray within the surface would take for ever.
const STRETCHES_MAX: u32 = 20_000;
/// A stretch of fewer rounding steps is not halved further.
const SHORTEST: f64 = 4.0 * f64::EPSILON;
/// A blend without bounds is followed for so many times the distance of the ray from its first form.
const ENDLESS: f64 = 1e12;
/// The start of a ray is on the surface if its value is this many times what rounding of the start and of the value can make.
const START_ROUNDING: f64 = 8.0;

/// A quadric along the ray, `[c, b, a]` of `a s^2 + b s + c`, with all roundings of its coefficients.
#[derive(Debug, Clone, Copy)]
struct Along([Range; 3]);

impl Along {
    fn new(quadric: &Quadric, p: [Range; 3], d: DVec3) -> Self {
        let d = d.to_array().map(Range::exactly);
        let k = quadric.coefficients.map(Range::exactly);
        let two = Range::exactly(2.0);
        let mut sum = [k[9], Range::ZERO, Range::ZERO];
        for (index, i, j) in [(3, 0, 1), (4, 0, 2), (5, 1, 2)] {
            sum[0] = sum[0] + k[index] * (p[i] * p[j]);
            sum[1] = sum[1] + k[index] * (p[i] * d[j] + p[j] * d[i]);
            sum[2] = sum[2] + k[index] * (d[i] * d[j]);
        }
        for i in 0..3 {
            sum[0] = sum[0] + k[i] * p[i].square() + k[6 + i] * p[i];
            sum[1] = sum[1] + two * k[i] * (p[i] * d[i]) + k[6 + i] * d[i];
            sum[2] = sum[2] + k[i] * d[i].square();
        }
        Self(sum)
    }

    /// Returns the values and slopes within `radius` of `m`.
    fn about(&self, m: f64, radius: f64) -> RangeSlope {
        let [c, b, a] = self.0;
        let (m, h) = (Range::exactly(m), Range::about_zero(radius));
        let am = a * m;
        let slope = am + am + b;
        let ah = a * h;
        RangeSlope { value: (am + b) * m + c + slope * h + a * h.square(), slope: slope + ah + ah }
    }

    /// Returns value and slope at `s`, rounded.
    fn at(&self, s: f64) -> Slope {
        let [c, b, a] = self.0.map(Range::middle);
        Slope { value: (a * s + b) * s + c, slope: 2.0 * a * s + b }
    }
}

/// A form along the ray, with those of its perturbations that may act.
struct Leaf {
    base: Along,
    /// Perturbations in the common list.
    bumps: std::ops::Range<usize>,
}

/// The function of a blend along a ray.
struct Function<'a> {
    solid: &'a Solid,
    place: Place,
    leaves: Vec<Leaf>,
    bumps: Vec<(Along, f64)>,
}

/// Shows each crossing of the ray with the unit at `place` to `visit`, in order, until that breaks off. The ray is cut to `extent`, relative to the origin of its first form.
pub(crate) fn walk(solid: &Solid, unit: u32, ray: &Ray, visit: impl FnMut(Crossing) -> ControlFlow<()>) -> Walked {
    let place = solid.plan.units[unit as usize].place;
    let home = solid.forms[place.form].origin();
    let extent = solid.plan.boxes.extent(unit).moved(-home);
    let Some(local) = Local::within(&extent, home, ray) else {
        return Walked { starts_inside: false, ends_inside: false };
    };
    let (lo, hi) = (local.lo.max(-ENDLESS * local.unit()), local.hi.min(ENDLESS * local.unit()));
    let function = Function::new(solid, place, ray, &local, (lo, hi));
    let mut silent = Silent::none(function.tokens().len());
    let start =
        local.start_error.filter(|error| function.starts_on_surface(ray, &local, *error, &mut silent)).map(|_| lo);
    let mut walker = Walker::new(&local, visit);
    let mut isolation = Isolation { function: &function, silent, start, unit: local.unit(), stretches: 0 };
    // The walker itself knows whether it was broken off.
    let _ = isolation.isolate((lo, hi), 0, &mut walker);
    walker.finish(local.start_error.is_some())
}

impl<'a> Function<'a> {
    fn new(solid: &'a Solid, place: Place, ray: &Ray, local: &Local, (lo, hi): (f64, f64)) -> Self {
        let forms = &solid.forms[place.form..place.after(&solid.tokens).form];
        let mut bumps = Vec::new();
        let (m, radius) = (0.5 * (lo + hi), half(lo, hi));
        let leaf = |form: &crate::FreeForm| {
            let exact = Range::exactly;
            let p = (ray.origin.to_array().into_iter().zip(form.origin().to_array())).zip(ray.direction.to_array());
            let mut p = p.map(|((o, home), d)| exact(o) - exact(home) + exact(local.t0) * exact(d));
            let p = std::array::from_fn(|_| p.next().unwrap_or(Range::ZERO));
            let first = bumps.len();
            form.near_ray(p.map(Range::middle).into(), ray.direction, lo, hi, |index| {
                let perturbation = &form.perturbations()[index as usize];
                let along = Along::new(&perturbation.quadric, p, ray.direction);
                if perturbation.factor != 0.0 && along.about(m, radius).value.sign() >= 0.0 {
                    bumps.push((along, perturbation.factor));
                }
            });
            Leaf { base: Along::new(form.base(), p, ray.direction), bumps: first..bumps.len() }
        };
        let leaves = forms.iter().map(leaf).collect();
        Self { solid, place, leaves, bumps }
    }

    /// Whether the start of the ray is on the surface but for rounding.
    fn starts_on_surface(&self, ray: &Ray, local: &Local, point_error: f64, silent: &mut Silent) -> bool {
        let start = self.solid.local_linear(ray.at(ray.t_min), self.place);
        let Range { lo, hi } = self.about(local.lo, 0.0, silent).value;
        let noise = START_ROUNDING * (hi - lo) + point_error * start.gradient.length();
        lo <= noise && hi >= -noise
    }

    /// The tokens of the blend.
    fn tokens(&self) -> &[Token] {
        &self.solid.tokens[self.place.token..self.place.after(&self.solid.tokens).token]
    }

    /// Returns the values and slopes within `radius` of `m`; parts that say nothing there are added to the silent ones, unless it is one point alone.
    fn about(&self, m: f64, radius: f64, silent: &mut Silent) -> RangeSlope {
        self.evaluate(silent, radius > 0.0, |leaf| {
            let mut sum = leaf.base.about(m, radius);
            for (along, factor) in &self.bumps[leaf.bumps.clone()] {
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
            for (along, factor) in &self.bumps[leaf.bumps.clone()] {
                let Slope { value, slope } = along.at(s);
                let q = value.max(0.0);
                sum.value += factor * (q * q * q);
                sum.slope += 3.0 * factor * (q * q) * slope;
            }
            sum
        })
    }

    fn evaluate<V: Compared>(&self, silent: &mut Silent, marks: bool, leaf: impl Fn(&Leaf) -> V) -> V {
        let mut evaluation = Evaluation { function: self, silent, marks, leaf };
        evaluation.subtree(&mut self.place.clone()).expect("the whole is never silent")
    }
}

/// What a blend is evaluated in, if it can tell that one function is above another all along.
trait Compared: Valued {
    /// Whether the union of the two is `self`, whatever the other.
    fn hides(&self, psi: Psi, other: &Self) -> bool;
}

impl Compared for RangeSlope {
    fn hides(&self, psi: Psi, other: &Self) -> bool {
        let gap = match psi {
            Psi::Maximum => 0.0,
            Psi::Blend { width } => width,
            // It adds something of both everywhere.
            Psi::RFunction => return false,
        };
        self.value.lo >= (other.value.hi + gap).next_up()
    }
}

impl Compared for Slope {
    fn hides(&self, _: Psi, _: &Self) -> bool {
        false
    }
}

/// Tokens whose subtrees say nothing on a stretch and on all parts of it: a stack of bit sets, one for each stretch that is open.
struct Silent {
    words: Vec<u64>,
    /// Words of one set.
    size: usize,
}

impl Silent {
    fn none(tokens: usize) -> Self {
        let size = tokens.div_ceil(64);
        Self { words: vec![0; size], size }
    }

    /// Opens a part of the stretch.
    fn push(&mut self) {
        self.words.extend_from_within(self.words.len() - self.size..);
    }

    fn pop(&mut self) {
        self.words.truncate(self.words.len() - self.size);
    }

    fn holds(&self, token: usize) -> bool {
        self.words[self.words.len() - self.size + token / 64] >> (token % 64) & 1 == 1
    }

    fn add(&mut self, token: usize) {
        let top = self.words.len() - self.size;
        self.words[top + token / 64] |= 1 << (token % 64);
    }
}

/// One look at the function; it calls itself once a level.
struct Evaluation<'a, F> {
    function: &'a Function<'a>,
    silent: &'a mut Silent,
    /// Whether silent parts are noted.
    marks: bool,
    leaf: F,
}

impl<F> Evaluation<'_, F> {
    /// Returns the value of the subtree at `place`, which is left behind it; `None` where that is silent.
    fn subtree<V: Compared>(&mut self, place: &mut Place) -> Option<V>
    where
        F: Fn(&Leaf) -> V,
    {
        let (tokens, first) = (&self.function.solid.tokens, self.function.place);
        let start = *place;
        if self.silent.holds(start.token - first.token) {
            *place = start.after(tokens);
            return None;
        }
        let Token::Join(Join { operation, psi, parts, .. }) = place.next(tokens) else {
            return Some((self.leaf)(&self.function.leaves[start.form - first.form]));
        };
        // Every operation but the union is the complement of a union of parts or of their complements.
        let mut sum: Option<V> = None;
        let parts_start = place.token;
        for index in 0..parts {
            let part_start = place.token;
            let Some(part) = self.subtree::<V>(place) else { continue };
            let flips = match operation {
                Operation::Union | Operation::Complement => false,
                Operation::Difference => index == 0,
                Operation::Intersection => true,
            };
            let part = if flips { part.complement() } else { part };
            sum = Some(match sum {
                None => part,
                Some(sum) if sum.hides(psi, &part) => {
                    if self.marks {
                        self.silent.add(part_start - first.token);
                    }
                    sum
                }
                Some(sum) if part.hides(psi, &sum) => {
                    if self.marks {
                        (parts_start..part_start).for_each(|token| self.silent.add(token - first.token));
                    }
                    part
                }
                Some(sum) => V::union(psi, sum, part),
            });
        }
        sum.map(|sum| if operation == Operation::Union { sum } else { sum.complement() })
    }
}

struct Isolation<'a> {
    function: &'a Function<'a>,
    silent: Silent,
    /// The start, where it is on the surface: nothing is asked of its sign.
    start: Option<f64>,
    unit: f64,
    stretches: u32,
}

impl Isolation<'_> {
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
        let mean = self.function.about(m, 0.0, &mut self.silent).value + all.slope * Range::about_zero(radius);
        if mean.sign() != 0.0 {
            return walker.stretch(lo, hi, mean.sign() > 0.0);
        }
        if all.slope.sign() != 0.0 {
            let (start, function, silent) = (self.start, self.function, &mut self.silent);
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
                    let root = polish((lo, m, hi), inside, f64::EPSILON * self.unit, value_and_slope);
                    walker.root((lo, root, hi), inside)
                }
            };
        }
        if depth == DEPTH_MAX || self.stretches > STRETCHES_MAX || hi - lo <= SHORTEST * (m.abs() + self.unit) {
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
