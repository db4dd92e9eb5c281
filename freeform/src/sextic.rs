//! Roots on one piece where perturbations act: a polynomial of degree six, isolated by Bernstein signs and polished by
//! Newton's method.

use std::ops::ControlFlow;

use crate::{
    Crossing,
    bernstein::{COUNT, Cube, Span, sextic_on, signs},
    polish::polish,
    quadratic::Quadratic,
    trace::{Local, Walker, value_noise},
};

/// Cuts in half before a span counts as a point: more than the 53 bits of a finite one, and 1e72 units for an infinite
/// one.
const DEPTH_MAX: u32 = 60;
/// Spans that one piece may be cut into. Six roots a rounding apart take about 400; more are only asked for where
/// rounding hides the sign over long stretches, or by numbers that overflow: there the signs that are known must do.
const SPANS_MAX: u32 = 1000;

/// The function along the ray, on the piece where just these perturbations act.
pub(crate) struct Sextic<'a> {
    pub(crate) local: &'a Local,
    pub(crate) base: Quadratic,
    /// Sum of the absolute terms of the base, as a polynomial in |s|.
    pub(crate) base_weight: Quadratic,
    pub(crate) cubes: &'a [Cube],
    /// Where the ray starts, and the value below which it starts on the surface.
    pub(crate) start: Option<(f64, f64)>,
}

impl Sextic<'_> {
    /// Walks the piece from `lo` to `hi`.
    pub(crate) fn walk<V: FnMut(Crossing) -> ControlFlow<()>>(
        &self,
        lo: f64,
        hi: f64,
        walker: &mut Walker<V>,
    ) -> ControlFlow<()> {
        let finite = if lo.is_finite() { lo } else { hi };
        let step = self.local.unit() + finite.abs();
        self.isolate(Span { lo, hi, step }, 0, &mut 0, walker)
    }

    /// Cuts the span until each part has a known number of roots: none or one.
    fn isolate<V: FnMut(Crossing) -> ControlFlow<()>>(
        &self,
        span: Span,
        depth: u32,
        spans: &mut u32,
        walker: &mut Walker<V>,
    ) -> ControlFlow<()> {
        *spans += 1;
        let is_last = depth == DEPTH_MAX || *spans > SPANS_MAX;
        let (mut coefficients, weights) = sextic_on(self.base, self.base_weight, self.cubes, span);
        let starts_on_surface =
            self.start.is_some_and(|(start, noise)| span.lo == start && coefficients[0].abs() <= noise);
        if starts_on_surface {
            coefficients[0] = 0.0;
        }
        let signs = signs(&coefficients, weights.map(value_noise));
        let Span { lo, hi, .. } = span;
        if signs.first == 0.0 {
            // Zero in every digit is the surface itself, which is inside; else rounding hides the sign and the walker
            // keeps the last one.
            return if coefficients == [0.0; COUNT] { walker.stretch(lo, hi, true) } else { ControlFlow::Continue(()) };
        }
        let inside = signs.first > 0.0;
        let settled = !signs.doubtful || is_last;
        if signs.variations == 0 && settled {
            return walker.stretch(lo, hi, inside);
        }
        // From a start on the surface the span is cut first, so that the polish cannot fall back to the start.
        if signs.variations == 1 && settled && !starts_on_surface && lo.is_finite() && hi.is_finite() {
            let from = lo + (hi - lo) * polygon_root(&coefficients, inside);
            let tolerance = f64::EPSILON * self.local.unit();
            let root = polish((lo, from, hi), inside, tolerance, |s| self.value_and_slope(s));
            return walker.root((lo, root, hi), inside);
        }
        if is_last {
            walker.stretch(lo, lo, inside)?;
            return walker.stretch(hi, hi, signs.last > 0.0);
        }
        let (lower, upper) = span.halves();
        self.isolate(lower, depth + 1, spans, walker)?;
        self.isolate(upper, depth + 1, spans, walker)
    }

    /// Returns value and slope at `s`, from the quadratics themselves.
    #[inline]
    fn value_and_slope(&self, s: f64) -> (f64, f64) {
        let mut value = self.base.at(s);
        let mut slope = self.base.slope(s);
        for &Cube { quadratic: q, factor, .. } in self.cubes {
            let (at, change) = (q.at(s), q.slope(s));
            let square = factor * (at * at);
            value += square * at;
            slope += 3.0 * square * change;
        }
        (value, slope)
    }
}

/// Returns where, in [0, 1], the control polygon leaves its first sign.
fn polygon_root(coefficients: &[f64; COUNT], inside: bool) -> f64 {
    let mut at = 0.0;
    for pair in coefficients.windows(2) {
        let &[a, b] = pair else { continue };
        if (b > 0.0) != inside {
            let share = a / (a - b);
            return (at + if share > 0.0 && share < 1.0 { share } else { 0.5 }) / 6.0;
        }
        at += 1.0;
    }
    0.5
}
