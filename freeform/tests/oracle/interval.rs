//! Crossings counted in f64 intervals for all forms whose coefficients differ by a relative 1e-14: quick, and silent
//! where that does not settle it.

use std::ops::{Add, Mul, Neg, Sub};

use super::{Counted, RawForm, RawRay};

/// Numbers between two bounds, rounded outwards.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    pub(super) lo: f64,
    pub(super) hi: f64,
}

impl Range {
    pub(super) fn new(lo: f64, hi: f64) -> Self {
        Self { lo: lo.next_down(), hi: hi.next_up() }
    }

    pub(super) fn exactly(x: f64) -> Self {
        Self { lo: x, hi: x }
    }

    pub(super) fn about(x: f64, share: f64) -> Self {
        let spread = (x.abs() * share).next_up();
        Self::new(x - spread, x + spread)
    }

    pub(super) fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        let lo = if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { a.min(b).next_down().max(0.0) };
        Self { lo, hi: a.max(b).next_up() }
    }

    pub(super) fn positive_part(self) -> Self {
        Self { lo: self.lo.max(0.0), hi: self.hi.max(0.0) }
    }

    pub(super) fn sqrt(self) -> Self {
        Self { lo: self.lo.sqrt().next_down().max(0.0), hi: self.hi.sqrt().next_up() }
    }

    /// Returns the quotient by a range without zero.
    pub(super) fn over(self, d: Self) -> Self {
        let q = [self.lo / d.lo, self.lo / d.hi, self.hi / d.lo, self.hi / d.hi];
        Self::new(q.into_iter().fold(f64::INFINITY, f64::min), q.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }

    /// Returns -1, 1, or `None` where zero is within.
    pub(super) fn sign(self) -> Option<i32> {
        if self.lo > 0.0 {
            Some(1)
        } else if self.hi < 0.0 {
            Some(-1)
        } else {
            None
        }
    }
}

impl Add for Range {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.lo + o.lo, self.hi + o.hi)
    }
}

impl Neg for Range {
    type Output = Self;
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}

impl Sub for Range {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul for Range {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let p = [self.lo * o.lo, self.lo * o.hi, self.hi * o.lo, self.hi * o.hi];
        Self::new(p.into_iter().fold(f64::INFINITY, f64::min), p.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }
}

pub(super) type Quadratic = [Range; 3];

/// Returns a quadric along a ray, of which the coefficients may be off by a share of them.
pub(super) fn along(q: &[f64; 10], ray: &RawRay, spread: f64) -> Quadratic {
    let o = ray.origin.map(Range::exactly);
    let d = ray.direction.map(Range::exactly);
    let k = q.map(|x| Range::about(x, spread));
    let one = Range::exactly(1.0);
    let zero = Range::exactly(0.0);
    let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3), (3, 3)];
    let (o, d) = ([o[0], o[1], o[2], one], [d[0], d[1], d[2], zero]);
    let mut sum = [zero; 3];
    for ((i, j), c) in pairs.into_iter().zip(k) {
        let (oo, dd) = if i == j { (o[i].square(), d[i].square()) } else { (o[i] * o[j], d[i] * d[j]) };
        sum[0] = sum[0] + c * oo;
        sum[1] = sum[1] + c * (o[i] * d[j] + o[j] * d[i]);
        sum[2] = sum[2] + c * dd;
    }
    sum
}

/// Returns the quadratic in t' = t - shift.
pub(super) fn shifted([c, b, a]: Quadratic, shift: f64) -> Quadratic {
    let s = Range::exactly(shift);
    [(a * s + b) * s + c, b + a * (s + s), a]
}

pub(super) fn at([c, b, a]: Quadratic, t: Range) -> Range {
    (a * t + b) * t + c
}

/// Returns enclosures of the roots, or `None` where their number is open.
fn roots([c, b, a]: Quadratic) -> Option<Vec<Range>> {
    let sign = a.sign()?;
    let discriminant = b.square() - Range::exactly(4.0) * a * c;
    if discriminant.sign()? < 0 {
        return Some(Vec::new());
    }
    let root = discriminant.sqrt();
    let twice = a + a;
    // The quotient with the larger numerator keeps its digits; the other root is c / (a r).
    let b_positive = b.lo + b.hi > 0.0;
    let q = if b_positive { -(b + root) } else { root - b };
    q.sign()?;
    let (r, s) = (q.over(twice), (c + c).over(q));
    let ascending = (sign > 0) == b_positive;
    Some(if ascending { vec![r, s] } else { vec![s, r] })
}

struct Bumps<'a>(&'a [(Quadratic, Range)]);

/// Returns the number of crossings and the sides of both ends where all forms agree.
pub(crate) fn count(form: &RawForm, ray: &RawRay, spread: f64) -> Option<Counted> {
    count_and_find(form, ray, spread, None)
}

/// Returns the same for a finite ray, and writes between which ray parameters each crossing is.
pub(crate) fn find(form: &RawForm, ray: &RawRay, spread: f64, found: &mut Vec<(f64, f64)>) -> Option<Counted> {
    found.clear();
    let counted = count_and_find(form, ray, spread, Some(found))?;
    assert_eq!(usize::try_from(counted.crossings), Ok(found.len()), "every crossing is found on a finite ray");
    Some(counted)
}

fn count_and_find(
    form: &RawForm,
    ray: &RawRay,
    spread: f64,
    mut found: Option<&mut Vec<(f64, f64)>>,
) -> Option<Counted> {
    let finite = ray.t_min.is_finite() && ray.t_max.is_finite();
    let shift = if finite { 0.5 * (ray.t_min + ray.t_max) } else { 0.0 };
    let base = shifted(along(&form.base, ray, spread), shift);
    let bumps: Vec<(Quadratic, Range)> = form
        .perturbations
        .iter()
        .filter(|(_, f)| *f != 0.0)
        .map(|(q, f)| (shifted(along(q, ray, spread), shift), Range::about(*f, spread)))
        .collect();
    let end = |t: f64| if t.is_finite() { Range::new(t - shift, t - shift) } else { Range::exactly(t) };
    let (start, stop) = (end(ray.t_min), end(ray.t_max));
    let mut breaks = vec![start, stop];
    for (q, _) in &bumps {
        for r in roots(*q)? {
            if r.hi < start.lo || r.lo > stop.hi {
                continue;
            }
            if r.lo <= start.hi || r.hi >= stop.lo {
                return None;
            }
            breaks.push(r);
        }
    }
    breaks.sort_by(|a, b| a.lo.total_cmp(&b.lo));
    if breaks.windows(2).any(|pair| pair[0].hi >= pair[1].lo) {
        return None;
    }
    let all = |t: Range| {
        bumps.iter().fold(at(base, t), |sum, (q, f)| {
            let q = at(*q, t).positive_part();
            sum + *f * (q.square() * q)
        })
    };
    // No root may hide in an enclosure of a break; infinite ends are judged with their pieces.
    let mut sides = Vec::new();
    for t in breaks.iter().filter(|t| t.lo.is_finite()) {
        sides.push(all(*t).sign()?);
    }
    let (mut crossings, mut starts_inside, mut stops_inside) = (0, None, None);
    for pair in breaks.windows(2) {
        let (lo, hi) = (pair[0].hi, pair[1].lo);
        let middle = Range::exactly(match (lo.is_finite(), hi.is_finite()) {
            (true, true) => 0.5 * (lo + hi),
            (true, false) => lo + 1.0,
            (false, true) => hi - 1.0,
            (false, false) => 0.0,
        });
        let mut acting = Vec::new();
        for bump in &bumps {
            if at(bump.0, middle).sign()? > 0 {
                acting.push(*bump);
            }
        }
        let bumps = Bumps(&acting);
        if lo.is_finite() && hi.is_finite() {
            let mut between = Vec::new();
            crossings += count_on(base, &bumps, lo, hi, 0, &mut between)?.0;
            // Narrowing takes most of the time where nobody asks for it.
            if let Some(found) = &mut found {
                for (mut lo, mut hi) in between {
                    narrow(&all, &mut lo, &mut hi);
                    found.push(((lo + shift).next_down(), (hi + shift).next_up()));
                }
            }
            continue;
        }
        // Infinite pieces start from their finite end, or from 0.
        if !hi.is_finite() {
            let (count, last) = count_up(base, &bumps, if lo.is_finite() { lo } else { 0.0 }, 1.0)?;
            crossings += count;
            stops_inside = Some(last > 0);
        }
        if !lo.is_finite() {
            let mirrored: Vec<_> = acting.iter().map(|(q, f)| (mirror(*q), *f)).collect();
            let (count, last) = count_up(mirror(base), &Bumps(&mirrored), if hi.is_finite() { -hi } else { 0.0 }, 1.0)?;
            crossings += count;
            starts_inside = Some(last > 0);
        }
    }
    let starts_inside = starts_inside.unwrap_or_else(|| sides[0] > 0);
    let ends_inside = stops_inside.unwrap_or_else(|| sides[sides.len() - 1] > 0);
    Some(Counted { crossings, starts_inside, ends_inside })
}

/// Halves the stretch about a root while the sign in the middle is known.
pub(super) fn narrow(function: &impl Fn(Range) -> Range, lo: &mut f64, hi: &mut f64) {
    let Some(before) = function(Range::exactly(*lo)).sign() else { return };
    while *hi - *lo > 1e-13 * (1.0 + hi.abs()) {
        let middle = 0.5 * (*lo + *hi);
        match function(Range::exactly(middle)).sign() {
            None => return,
            Some(sign) if sign == before => *lo = middle,
            Some(_) => *hi = middle,
        }
    }
}

fn mirror([c, b, a]: Quadratic) -> Quadratic {
    [c, -b, a]
}

/// Returns the number of roots beyond `lo` and the sign at infinity.
fn count_up(base: Quadratic, bumps: &Bumps<'_>, lo: f64, step: f64) -> Option<(i32, i32)> {
    let (a, w) = (Range::exactly(lo), Range::exactly(step));
    // Scaled Bernstein coefficients of (1 - u)^2 q(lo + step u / (1 - u)).
    let scaled = |q: Quadratic| [at(q, a), (q[1] + (q[2] + q[2]) * a) * w, q[2] * w * w];
    let mut sum = [Range::exactly(0.0); 7];
    sum[..3].copy_from_slice(&scaled(base));
    add_cubes(&mut sum, bumps, scaled);
    let length = if bumps.0.is_empty() { 3 } else { 7 };
    let last = sum[length - 1].sign()?;
    if let Some(count) = settled(&sum[..length]) {
        return Some((count, last));
    }
    if step > 1e6 {
        return None;
    }
    let (below, _) = count_on(base, bumps, lo, lo + step, 0, &mut Vec::new())?;
    let (above, last) = count_up(base, bumps, lo + step, 4.0 * step)?;
    Some((below + above, last))
}

fn add_cubes(sum: &mut [Range; 7], bumps: &Bumps<'_>, scaled: impl Fn(Quadratic) -> [Range; 3]) {
    let zero = Range::exactly(0.0);
    for (q, f) in bumps.0 {
        let linear = scaled(*q);
        let mut square = [zero; 5];
        let mut cube = [zero; 7];
        for (i, x) in linear.iter().enumerate() {
            for (j, y) in linear.iter().enumerate() {
                square[i + j] = square[i + j] + *x * *y;
            }
        }
        for (i, x) in square.iter().enumerate() {
            for (j, y) in linear.iter().enumerate() {
                cube[i + j] = cube[i + j] + *x * *y;
            }
        }
        for (s, c) in sum.iter_mut().zip(cube) {
            *s = *s + *f * c;
        }
    }
}

/// Returns the number of roots where the signs of the coefficients settle it.
fn settled(coefficients: &[Range]) -> Option<i32> {
    let (mut changes, mut previous, mut unknown) = (0, coefficients[0].sign()?, 0);
    coefficients[coefficients.len() - 1].sign()?;
    for sign in coefficients.iter().map(|c| c.sign()) {
        let Some(sign) = sign else {
            unknown += 1;
            continue;
        };
        // What is between equal signs may add two changes, and so may two between different ones.
        if unknown > 1 || (unknown == 1 && sign == previous) {
            return None;
        }
        changes += i32::from(sign != previous);
        (previous, unknown) = (sign, 0);
    }
    (changes <= 1).then_some(changes)
}

/// Returns the number of roots between two places where the sign is known, and the sign at the second; writes between
/// which numbers each root is.
fn count_on(
    base: Quadratic,
    bumps: &Bumps<'_>,
    lo: f64,
    hi: f64,
    depth: u32,
    found: &mut Vec<(f64, f64)>,
) -> Option<(i32, i32)> {
    let n = Range::exactly;
    let (a, b) = (n(lo), n(hi));
    let scaled = |q: Quadratic| [at(q, a), q[0] + q[0] + q[1] * (a + b) + (q[2] + q[2]) * a * b, at(q, b)];
    let [f0, f1, f2] = scaled(base);
    let (four, six) = (n(4.0), n(6.0));
    let elevated = [
        f0,
        four * f0 + f1,
        six * f0 + four * f1 + f2,
        four * (f0 + f2) + six * f1,
        six * f2 + four * f1 + f0,
        four * f2 + f1,
        f2,
    ];
    let mut sum = elevated;
    add_cubes(&mut sum, bumps, scaled);
    let last = sum[6].sign()?;
    if let Some(count) = settled(&sum) {
        found.extend((count == 1).then_some((lo, hi)));
        return Some((count, last));
    }
    if depth > 40 {
        return None;
    }
    let middle = 0.5 * (lo + hi);
    let (lower, _) = count_on(base, bumps, lo, middle, depth + 1, found)?;
    let (upper, last) = count_on(base, bumps, middle, hi, depth + 1, found)?;
    Some((lower + upper, last))
}
