//! One root between two places where the sign is known.

/// Steps of the polish. Newton's needs about five; a triple root needs about 40 with bisection between.
const STEPS_MAX: u32 = 100;

/// Returns the root between `lo` and `hi`: Newton's method from `s`, kept between ends of known signs by bisection,
/// until a step is shorter than rounding of s or than `tolerance`. `function` gives value and slope; it is positive at
/// `lo` where `inside` is set, and has the other sign at `hi`.
#[inline]
pub(crate) fn polish(
    (mut lo, mut s, mut hi): (f64, f64, f64),
    inside: bool,
    tolerance: f64,
    mut function: impl FnMut(f64) -> (f64, f64),
) -> f64 {
    let mut last_step = hi - lo;
    for _ in 0..STEPS_MAX {
        let (value, slope) = function(s);
        if value == 0.0 {
            break;
        }
        if (value > 0.0) == inside {
            lo = s;
        } else {
            hi = s;
        }
        let mut next = s - value / slope;
        // Written so that a slope of zero, infinity or NaN bisects; so does a step that did not shrink.
        if !(next > lo && next < hi && (next - s).abs() < 0.5 * last_step) {
            next = 0.5 * (lo + hi);
        }
        last_step = (next - s).abs();
        s = next;
        if last_step <= tolerance + f64::EPSILON * s.abs() {
            break;
        }
    }
    s
}
