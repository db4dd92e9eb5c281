//! A ray through one free form: every place where the sign of its function changes, in order.
//!
//! Along a ray each quadric is a quadratic in the ray parameter. The roots of the perturbing quadratics cut the ray
//! into pieces; on each the function is a polynomial of degree two (the base alone: solved in closed form) or six (see
//! `sextic`). The pieces are walked in order by a `Walker` that knows on which side it is: a sign that differs from the
//! last known one is a crossing, so a root at the end of a piece is neither lost nor doubled.
//!
//! Nothing is expanded about a far point: the ray's origin is moved beside the form before coefficients are formed.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::{
    Crossing, FreeForm, Perturbation, Quadric, Ray,
    bernstein::Cube,
    bounds::Extent,
    buffer::Buffer,
    quadratic::{Quadratic, Roots},
    sextic::Sextic,
};

/// Rays near up to `LARGE` perturbations use the stack alone; for more there are a few allocations a ray.
const SMALL: usize = 8;
/// See `SMALL`; the larger arrays cost 4 KB of zeros.
const LARGE: usize = 32;

/// Rounding of a value as a share of its absolute terms. A dip shallower than this is a touch, not two crossings.
const VALUE_ROUNDING: f64 = 0.5 * f64::EPSILON;
/// A start so near to the surface, in shares as above, is on the surface. Hit points that a caller computes carry
/// several roundings.
const START_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Rounding of a start point as a share of the largest number that entered it; a hit near the form's origin has the
/// rounding of the ray that found it, which is that of the form's size at least.
const POINT_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The ray in the frame of a form: `p + s d` with s = t - t0, and p the point of the ray nearest to the form's origin,
/// or to its middle if that is elsewhere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Local {
    pub(crate) p: DVec3,
    pub(crate) d: DVec3,
    pub(crate) t0: f64,
    /// Ends of the ray.
    t_min: f64,
    t_max: f64,
    /// Ends of the ray in the box of the form, less t0.
    pub(crate) lo: f64,
    pub(crate) hi: f64,
    /// Lengths of p and d.
    p_length: f64,
    d_length: f64,
    /// Rounding error of the start, where the ray starts at its own start and not at the form's box.
    pub(crate) start_error: Option<f64>,
}

impl Local {
    /// Moves the ray to the form, cut to its box; `None` where it misses that.
    #[inline]
    fn new(form: &FreeForm, ray: &Ray) -> Option<Self> {
        Self::within(form.extent(), form.origin(), ray)
    }

    /// Moves the ray to `home`, cut to a box relative to that; `None` where it misses the box.
    #[inline]
    pub(crate) fn within(extent: &Extent, home: DVec3, ray: &Ray) -> Option<Self> {
        if !ray.is_sound() || extent.is_empty() {
            return None;
        }
        let (o, d) = (ray.origin - home, ray.direction);
        let (near, far) = extent.clip(o, d, ray.t_min, ray.t_max)?;
        // The middle of the box, but along an axis along which it holds the form's origin that: numbers are smallest
        // about there, and where a loose box reached 130 far from a small body, terms that cancel hid its crossings.
        let holds_origin = extent.min.cmple(DVec3::ZERO) & extent.max.cmpge(DVec3::ZERO);
        let middle = 0.5 * (extent.min + extent.max);
        let middle = DVec3::select(middle.is_finite_mask() & !holds_origin, middle, DVec3::ZERO);
        let t0 = ((middle - o).dot(d) / d.length_squared()).clamp(near, far);
        let p = o + t0 * d;
        let d_length = d.length();
        let start_error = (near == ray.t_min && near.is_finite()).then(|| {
            let largest = ray.origin.length() + home.length() + near.abs() * d_length;
            POINT_ROUNDING * (largest + extent.longest_side())
        });
        let local = Self {
            p,
            d,
            t0,
            t_min: ray.t_min,
            t_max: ray.t_max,
            lo: near - t0,
            hi: far - t0,
            p_length: p.length(),
            d_length,
            start_error,
        };
        (p.is_finite() && local.lo < local.hi).then_some(local)
    }

    /// Returns the change of s that moves a point by as much as p is long: the unit in which an infinite span is cut
    /// and below whose rounding no root is polished.
    #[inline]
    pub(crate) fn unit(&self) -> f64 {
        let unit = self.p_length / self.d_length;
        if unit > 0.0 { unit } else { self.d_length.recip() }
    }
}

/// A perturbation along the ray and where it acts.
#[derive(Debug, Clone, Copy)]
struct Bump {
    cube: Cube,
    /// Place in the form.
    index: usize,
    lo: f64,
    hi: f64,
    /// It acts outside (lo, hi) instead of inside.
    outside: bool,
}

impl Bump {
    const NONE: Self = Self { cube: Cube::ZERO, index: 0, lo: 0.0, hi: 0.0, outside: false };

    /// Returns the perturbation along the ray if it acts anywhere on it.
    #[inline]
    fn new(index: usize, perturbations: &[Perturbation], local: &Local) -> Option<Self> {
        let perturbation = &perturbations[index];
        let quadratic = perturbation.quadric.along(local.p, local.d);
        let (lo, hi, outside) = match quadratic.roots() {
            Roots::None => {
                (quadratic.sign_at_minus_infinity() > 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY, false))?
            }
            Roots::One(root) if quadratic.b > 0.0 => (root, f64::INFINITY, false),
            Roots::One(root) => (f64::NEG_INFINITY, root, false),
            Roots::Two(lo, hi) => (lo, hi, quadratic.a > 0.0),
        };
        let acts = if outside { local.lo < lo || hi < local.hi } else { local.lo < hi && lo < local.hi };
        let Perturbation { quadric, factor } = perturbation;
        (acts && *factor != 0.0).then(|| {
            let weight = quadric.weight_along(local.p, local.d);
            Self { cube: Cube { quadratic, factor: *factor, weight }, index, lo, hi, outside }
        })
    }

    /// Says whether it acts on a piece; pieces end at `lo` and `hi`.
    #[inline]
    fn acts_on(&self, lo: f64, hi: f64) -> bool {
        if self.outside { hi <= self.lo || self.hi <= lo } else { self.lo <= lo && hi <= self.hi }
    }
}

/// Arrays for one ray.
struct Scratch<'a> {
    bumps: &'a mut [Bump],
    acting: &'a mut [Cube],
    breaks: &'a mut [f64],
}

/// What is known after a walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Walked {
    /// Whether the ray is inside just beyond its start.
    pub(crate) starts_inside: bool,
    /// Whether it is inside just before its end, or where the visitor stopped it.
    pub(crate) ends_inside: bool,
}

/// Shows each crossing of the ray with the surface to `visit`, in order, until that breaks off.
pub(crate) fn walk(form: &FreeForm, ray: &Ray, visit: impl FnMut(Crossing) -> ControlFlow<()>) -> Walked {
    let Some(local) = Local::new(form, ray) else {
        return Walked { starts_inside: false, ends_inside: false };
    };
    const AFTER_SMALL: usize = SMALL + 1;
    let mut near = Buffer::<u32, LARGE>::new(0);
    form.near_ray(local.p, local.d, local.lo, local.hi, |index| near.push(index));
    // In the order of the form, so that what is far away changes no bit of a sum.
    near.entries_mut().sort_unstable();
    let near = near.entries();
    match near.len() {
        0 => walk_with::<0, 3>(form, &local, near, visit),
        1..=SMALL => walk_with::<SMALL, { 2 * SMALL + 3 }>(form, &local, near, visit),
        AFTER_SMALL..=LARGE => walk_with::<LARGE, { 2 * LARGE + 3 }>(form, &local, near, visit),
        n => {
            let (mut bumps, mut acting, mut breaks) = (vec![Bump::NONE; n], vec![Cube::ZERO; n], vec![0.0; 2 * n + 3]);
            let scratch = Scratch { bumps: &mut bumps, acting: &mut acting, breaks: &mut breaks };
            walk_pieces(form, &local, near, scratch, visit)
        }
    }
}

/// Walks with arrays on the stack.
fn walk_with<const N: usize, const BREAKS: usize>(
    form: &FreeForm,
    local: &Local,
    near: &[u32],
    visit: impl FnMut(Crossing) -> ControlFlow<()>,
) -> Walked {
    let (mut bumps, mut acting, mut breaks) = ([Bump::NONE; N], [Cube::ZERO; N], [0.0; BREAKS]);
    let scratch = Scratch { bumps: &mut bumps, acting: &mut acting, breaks: &mut breaks };
    walk_pieces(form, local, near, scratch, visit)
}

/// Cuts the ray into pieces and walks them.
fn walk_pieces(
    form: &FreeForm,
    local: &Local,
    near: &[u32],
    scratch: Scratch<'_>,
    visit: impl FnMut(Crossing) -> ControlFlow<()>,
) -> Walked {
    let Scratch { bumps, acting, breaks } = scratch;
    let mut count = 0;
    for bump in near.iter().filter_map(|&index| Bump::new(index as usize, form.perturbations(), local)) {
        bumps[count] = bump;
        count += 1;
    }
    let bumps = &bumps[..count];
    let breaks = sorted_breaks(bumps, local, breaks);

    let base = form.base().along(local.p, local.d);
    let base_weight = form.base().weight_along(local.p, local.d);
    let mut walker = Walker::new(local, visit);
    let mut start_noise = local.start_error.map(|error| start_noise(form, base_weight, bumps, local, error));
    for piece in breaks.windows(2) {
        let &[lo, hi] = piece else { continue };
        let mut active = 0;
        for bump in bumps.iter().filter(|bump| bump.acts_on(lo, hi)) {
            acting[active] = bump.cube;
            active += 1;
        }
        let flow = if active == 0 {
            walker.conic(base, base_weight, (lo, hi), start_noise)
        } else {
            let sextic = Sextic {
                local,
                base,
                base_weight,
                cubes: &acting[..active],
                start: start_noise.map(|noise| (lo, noise)),
            };
            sextic.walk(lo, hi, &mut walker)
        };
        start_noise = None;
        if flow.is_break() {
            break;
        }
    }
    walker.finish(local.start_error.is_some())
}

/// Writes the ends of the pieces in order: both ends of the ray, the roots between, and 0 between two infinite ends.
fn sorted_breaks<'a>(bumps: &[Bump], local: &Local, breaks: &'a mut [f64]) -> &'a [f64] {
    breaks[0] = local.lo;
    let mut count = 1;
    let mut insert = |s: f64| {
        if s > local.lo && s < local.hi {
            let mut k = count;
            while breaks[k - 1] > s {
                breaks[k] = breaks[k - 1];
                k -= 1;
            }
            if breaks[k - 1] < s {
                breaks[k] = s;
                count += 1;
            } else {
                // The same root twice: close the gap again.
                breaks.copy_within(k + 1..=count, k);
            }
        }
    };
    for bump in bumps {
        insert(bump.lo);
        insert(bump.hi);
    }
    if local.lo == f64::NEG_INFINITY && local.hi == f64::INFINITY {
        insert(0.0);
    }
    breaks[count] = local.hi;
    &breaks[..=count]
}

/// Returns the value below which the start counts as on the surface.
fn start_noise(form: &FreeForm, base_weight: Quadratic, bumps: &[Bump], local: &Local, point_error: f64) -> f64 {
    let start = local.p + local.lo * local.d;
    let noise = |quadric: &Quadric, weight: Quadratic| {
        START_ROUNDING * weight.at(local.lo.abs()) + point_error * quadric.gradient_weight(start).element_sum()
    };
    let bumps = bumps.iter().map(|bump| {
        let q = bump.cube.quadratic.at(local.lo);
        // Nothing is lost where it does not act.
        if q > 0.0 {
            bump.cube.error(q, noise(&form.perturbations()[bump.index].quadric, bump.cube.weight))
        } else {
            0.0
        }
    });
    noise(form.base(), base_weight) + bumps.sum::<f64>()
}

/// Follows the sign of the function along the ray.
pub(crate) struct Walker<V> {
    t0: f64,
    t_min: f64,
    t_max: f64,
    /// Last known side: inside or not.
    state: Option<bool>,
    /// First known side.
    initial: Option<bool>,
    /// Where the last known stretch ended.
    last: f64,
    /// A crossing beyond which no stretch of visible length has been seen yet.
    pending: Option<Crossing>,
    visit: V,
}

impl<V: FnMut(Crossing) -> ControlFlow<()>> Walker<V> {
    /// Returns a walker at the start of a ray.
    pub(crate) fn new(local: &Local, visit: V) -> Self {
        let Local { t0, t_min, t_max, lo, .. } = *local;
        Self { t0, t_min, t_max, state: None, initial: None, last: lo, pending: None, visit }
    }

    /// Returns what is known at the end.
    pub(crate) fn finish(self, starts_in_reach: bool) -> Walked {
        // A ray that stays in the surface is inside, for the solid is closed; at the edge of the box that is only
        // rounding.
        let initial = self.initial.unwrap_or(starts_in_reach);
        // A crossing at the very end has nothing beyond it.
        let last = self.state.unwrap_or(initial);
        Walked { starts_inside: initial, ends_inside: last != self.pending.is_some() }
    }

    /// Takes note that the function has one sign from `lo` to `hi`. After the other sign that is a crossing: in the
    /// middle of what rounding hides between the two.
    #[inline]
    pub(crate) fn stretch(&mut self, lo: f64, hi: f64, inside: bool) -> ControlFlow<()> {
        let before = self.state.replace(inside);
        let last = std::mem::replace(&mut self.last, hi);
        match before {
            None => self.initial = Some(inside),
            Some(side) if side != inside => {
                let s = if lo > last { 0.5 * (last + lo) } else { lo };
                self.cross(Crossing { t: (self.t0 + s).clamp(self.t_min, self.t_max), entering: inside, part: 0 })?;
            }
            Some(_) => {}
        }
        match self.pending {
            Some(crossing) if self.t0 + hi > crossing.t => {
                self.pending = None;
                (self.visit)(crossing)
            }
            _ => ControlFlow::Continue(()),
        }
    }

    /// Takes note of a crossing. Two at the same t enclose nothing and are none; one at the start only says where the
    /// ray starts.
    fn cross(&mut self, crossing: Crossing) -> ControlFlow<()> {
        match self.pending.take() {
            Some(earlier) if earlier.t >= crossing.t => return ControlFlow::Continue(()),
            Some(earlier) => (self.visit)(earlier)?,
            None => {}
        }
        if crossing.t > self.t_min {
            self.pending = Some(crossing);
        } else {
            self.initial = Some(crossing.entering);
        }
        ControlFlow::Continue(())
    }

    /// Takes note of two stretches with a root between them.
    #[inline]
    pub(crate) fn root(&mut self, (lo, root, hi): (f64, f64, f64), inside_before: bool) -> ControlFlow<()> {
        self.stretch(lo, root, inside_before)?;
        self.stretch(root, hi, !inside_before)
    }

    /// Walks a piece on which the base acts alone.
    #[inline]
    fn conic(
        &mut self,
        q: Quadratic,
        weight: Quadratic,
        (lo, hi): (f64, f64),
        start_noise: Option<f64>,
    ) -> ControlFlow<()> {
        if q == Quadratic::ZERO {
            return self.stretch(lo, hi, true);
        }
        if start_noise.is_some_and(|noise| q.at(lo).abs() <= noise) {
            return self.conic_from_root(q, lo, hi);
        }
        let mut inside = q.sign_at_minus_infinity() > 0.0;
        let (first, second) = match q.roots() {
            Roots::None => (f64::INFINITY, f64::INFINITY),
            Roots::One(root) => (root, f64::INFINITY),
            Roots::Two(first, second) => {
                let vertex = -0.5 * q.b / q.a;
                let touches = vertex.is_finite()
                    && (q.c + 0.5 * q.b * vertex).abs() <= VALUE_ROUNDING * weight.at(vertex.abs())
                    && is_hidden_between(q, weight, [first, second]);
                if touches { (f64::INFINITY, f64::INFINITY) } else { (first, second) }
            }
        };
        let mut from = lo;
        for root in [first, second] {
            if root >= hi {
                break;
            }
            if root > lo {
                self.stretch(from, root, inside)?;
                from = root;
            }
            inside = !inside;
        }
        self.stretch(from, hi, inside)
    }

    /// Walks such a piece from a start on the surface: that root is known, the slope tells the side beyond it and where
    /// the other root lies.
    fn conic_from_root(&mut self, q: Quadratic, lo: f64, hi: f64) -> ControlFlow<()> {
        let slope = q.slope(lo);
        let side = if slope == 0.0 { q.a } else { slope };
        let other = lo - slope / q.a;
        if side == 0.0 {
            ControlFlow::Continue(())
        } else if other > lo && other < hi {
            self.root((lo, other, hi), side > 0.0)
        } else {
            self.stretch(lo, hi, side > 0.0)
        }
    }
}

/// Whether rounding hides a quadratic everywhere between its roots. That it does at the vertex is not enough: of a line
/// that all but lies in a cone or a cylinder the vertex is far off, where rounding is large, and one of the roots may
/// be near.
fn is_hidden_between(q: Quadratic, weight: Quadratic, [first, second]: [f64; 2]) -> bool {
    let sign = -q.a.signum();
    // |q| less its rounding, for s of one sign: a quadratic of |s| that has a maximum.
    let shows = |side: f64, lo: f64, hi: f64| {
        let excess = Quadratic {
            a: -q.a.abs() - VALUE_ROUNDING * weight.a,
            b: sign * side * q.b - VALUE_ROUNDING * weight.b,
            c: sign * q.c - VALUE_ROUNDING * weight.c,
        };
        lo <= hi && excess.at((-0.5 * excess.b / excess.a).clamp(lo, hi)) > 0.0
    };
    !shows(1.0, first.max(0.0), second) && !shows(-1.0, (-second).max(0.0), -first)
}

/// Returns the value within which signs are rounding, from the weight of the terms.
pub(crate) fn value_noise(weight: f64) -> f64 {
    VALUE_ROUNDING * weight
}
