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
    quadratic::Quadratic,
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

/// A quadric along the ray, `a s^2 + b s + c`, and what its coefficients may be off at most.
///
/// Ranges of quadratics are what a ray asks most. So they have no interval arithmetic of their own but bounds of all roundings together (Higham 2002, Accuracy and
/// stability of numerical algorithms, section 3.1): no branch, and an eighth of the time.
#[derive(Debug, Clone, Copy)]
struct Along {
    quadratic: Quadratic,
    /// Errors of the coefficients, and room for the roundings of one evaluation.
    error: Quadratic,
}

/// A coefficient, after at most 16 roundings of half a step, is off by at most this share of its absolute terms.
const SUM_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// The same of the few operations between coefficients and a range.
const EVALUATION_ROUNDING: f64 = 4.0 * f64::EPSILON;

impl Along {
    /// Takes the quadric along `p + s d`, where each coordinate of `p` may be off by that of `error`.
    #[inline]
    fn new(quadric: &Quadric, p: DVec3, error: DVec3, d: DVec3) -> Self {
        let quadratic = quadric.along(p, d);
        let weight = quadric.weight_along(p.abs() + error, d);
        // Of an error e of p, b takes (H d) e and c the gradient times e, H the second derivatives.
        let moved = quadric.weight_moved(p.abs() + error, d, error);
        let share = SUM_ROUNDING + EVALUATION_ROUNDING;
        let error = Quadratic { a: share * weight.a, b: share * weight.b + moved.b, c: share * weight.c + moved.c };
        Self { quadratic, error }
    }

    /// Returns the values and slopes within `radius` of `m`.
    #[inline]
    fn about(&self, m: f64, radius: f64) -> RangeSlope {
        let (a, value, slope) = (self.quadratic.a, self.quadratic.at(m), self.quadratic.slope(m));
        let (value_error, slope_error) = (self.error.at(m.abs()), self.error.slope(m.abs()));
        // value + slope h + a h^2 and slope + 2 a h, for |h| up to the radius.
        let (linear, square) = ((slope.abs() + slope_error) * radius, (a.abs() + self.error.a) * radius * radius);
        let error =
            value_error + EVALUATION_ROUNDING * (value.abs() + linear + square) + self.error.a * radius * radius;
        let down = linear + error + if a < 0.0 { square } else { 0.0 };
        let up = linear + error + if a > 0.0 { square } else { 0.0 };
        let turn = 2.0 * (a.abs() + self.error.a) * radius;
        let turn = turn + slope_error + EVALUATION_ROUNDING * (slope.abs() + turn);
        RangeSlope {
            value: Range { lo: value - down, hi: value + up },
            slope: Range { lo: slope - turn, hi: slope + turn },
        }
    }

    /// Returns value and slope at `s`, rounded.
    #[inline]
    fn at(&self, s: f64) -> Slope {
        Slope { value: self.quadratic.at(s), slope: self.quadratic.slope(s) }
    }
}

/// Returns the point of the ray at `t` as seen from `home`, and how far each of its coordinates may be off.
fn seen_from(home: DVec3, ray: &Ray, t: f64) -> (DVec3, DVec3) {
    let (origin, step) = (ray.origin - home, t * ray.direction);
    let p = origin + step;
    (p, f64::EPSILON * (origin.abs() + step.abs() + p.abs()))
}

/// A form along the ray, with those of its perturbations that may act.
struct Leaf {
    base: Along,
    /// Perturbations in the common list.
    bumps: std::ops::Range<usize>,
}

impl Leaf {
    const NONE: Self = Self {
        base: Along { quadratic: Quadratic::ZERO, error: Quadratic::ZERO },
        bumps: std::ops::Range { start: 0, end: 0 },
    };
}

/// The function of a blend along a ray.
struct Function<'a> {
    solid: &'a Solid,
    place: Place,
    /// The tokens of the blend, and for each that is a form its leaf.
    tokens: &'a [Token],
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
    let mut silent = Silent::none(function.tokens.len());
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
        let tokens = &solid.tokens[place.token..place.after(&solid.tokens).token];
        let mut bumps = Vec::new();
        let (m, radius) = (0.5 * (lo + hi), half(lo, hi));
        let leaf = |form: &crate::FreeForm| {
            let (p, error) = seen_from(form.origin(), ray, local.t0);
            let first = bumps.len();
            form.near_ray(p, ray.direction, lo, hi, |index| {
                let perturbation = &form.perturbations()[index as usize];
                let along = Along::new(&perturbation.quadric, p, error, ray.direction);
                if perturbation.factor != 0.0 && along.about(m, radius).value.sign() >= 0.0 {
                    bumps.push((along, perturbation.factor));
                }
            });
            Leaf { base: Along::new(form.base(), p, error, ray.direction), bumps: first..bumps.len() }
        };
        let mut forms = solid.forms[place.form..].iter().map(leaf);
        let mut leaf_of = |token: &Token| if *token == Token::Form { forms.next() } else { None };
        let leaves = tokens.iter().map(|token| leaf_of(token).unwrap_or(Leaf::NONE)).collect();
        Self { solid, place, tokens, leaves, bumps }
    }

    /// Whether the start of the ray is on the surface but for rounding.
    fn starts_on_surface(&self, ray: &Ray, local: &Local, point_error: f64, silent: &mut Silent) -> bool {
        let start = self.solid.local_linear(ray.at(ray.t_min), self.place);
        let Range { lo, hi } = self.about(local.lo, 0.0, silent).value;
        let noise = START_ROUNDING * (hi - lo) + point_error * start.gradient.length();
        lo <= noise && hi >= -noise
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
        evaluation.subtree(&mut 0).expect("the whole is never silent")
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
    /// Returns the value of the subtree at `token`, which is left behind it; `None` where that is silent.
    #[inline(always)]
    fn subtree<V: Compared>(&mut self, token: &mut usize) -> Option<V>
    where
        F: Fn(&Leaf) -> V,
    {
        let start = *token;
        let is_silent = self.silent.holds(start);
        match self.function.tokens[start] {
            Token::Form => {
                *token += 1;
                (!is_silent).then(|| (self.leaf)(&self.function.leaves[start]))
            }
            Token::Join(join) if is_silent => {
                *token += 1 + join.length as usize;
                None
            }
            Token::Join(join) => self.join(join, token),
        }
    }

    /// Returns the value of the operation at `token`, which is left behind it; `None` where all parts are silent.
    fn join<V: Compared>(&mut self, Join { operation, psi, parts, .. }: Join, token: &mut usize) -> Option<V>
    where
        F: Fn(&Leaf) -> V,
    {
        let start = *token;
        *token += 1;
        // Every operation but the union is the complement of a union of parts or of their complements.
        let mut sum: Option<V> = None;
        for index in 0..parts {
            let part_start = *token;
            let Some(part) = self.subtree::<V>(token) else { continue };
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
                        self.silent.add(part_start);
                    }
                    sum
                }
                Some(sum) if part.hides(psi, &sum) => {
                    if self.marks {
                        (start + 1..part_start).for_each(|token| self.silent.add(token));
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

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "floats that are whole and fit")]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_quadratics_hold_what_integers_say() {
        let mut state = 1_u64;
        // Whole numbers below 2^bits.
        let mut whole = |bits: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            i128::from((state as i64) >> (63 - bits))
        };
        let number = |x: i128| x as f64;
        for k in 0..100_000_u32 {
            // So many bits that most sums and products round, and that exact ones fit 128. Some rays pass close by, so that all digits of a place cancel.
            let bits = 19 + k % 10;
            let mut vector = |bits: u32| [whole(bits), whole(bits), whole(bits)];
            let (home, d, t, s) =
                (vector(53), vector(bits), vector(bits)[0], vector(if k % 2 == 0 { 1 } else { bits })[0]);
            let near = [0, 1, 2].map(|i| number(home[i] - t * d[i]) as i128);
            let origin = if k % 3 == 0 { near } else { vector(53) };
            let float = |x: [i128; 3]| DVec3::from_array(x.map(number));
            let coefficients: [i128; 10] = std::array::from_fn(|i| vector(if i < 6 { 8 } else { 40 })[0]);
            let ray = Ray::new(float(origin), float(d));
            let (p, error) = seen_from(float(home), &ray, number(t));
            let quadric = Quadric { coefficients: coefficients.map(number) };
            let along = Along::new(&quadric, p, error, ray.direction);

            let [x, y, z] = [0, 1, 2].map(|i| origin[i] - home[i] + (t + s) * d[i]);
            let [a, b, c, d12, d13, d23, l1, l2, l3, rest] = coefficients;
            let value = a * x * x + b * y * y + c * z * z + d12 * x * y + d13 * x * z + d23 * y * z;
            let value = value + l1 * x + l2 * y + l3 * z + rest;
            let slope = (2 * a * x + d12 * y + d13 * z + l1) * d[0]
                + (d12 * x + 2 * b * y + d23 * z + l2) * d[1]
                + (d13 * x + d23 * y + 2 * c * z + l3) * d[2];
            let holds = |range: Range, x: i128| range.lo.floor() as i128 <= x && x <= range.hi.ceil() as i128;
            for radius in [0.0, 1.0, number(whole(bits)).abs()] {
                let middle = number(s) + radius * if k % 2 == 0 { 1.0 } else { -1.0 };
                let range = along.about(middle, radius);
                assert!(holds(range.value, value), "ray {k}, {radius}: {value} in {:?}", range.value);
                assert!(holds(range.slope, slope), "ray {k}, {radius}: slope {slope} in {:?}", range.slope);
                let far = p.abs() + error;
                let weight = quadric.weight_along(far, ray.direction).at(number(s).abs());
                let moved = quadric.weight_moved(far, ray.direction, error).at(number(s).abs());
                let rounding = 64.0 * f64::EPSILON * weight + 4.0 * moved;
                assert!(
                    radius > 0.0 || range.value.hi - range.value.lo < rounding,
                    "ray {k}: no wider than rounding asks"
                );
            }
        }
    }
}
