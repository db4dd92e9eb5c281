//! Sets of points on a ray: ordered, disjoint intervals and their algebra.
//!
//! A solid is a closed set, so along a ray it is a list of closed intervals. Union and difference of solids along the
//! ray are union and difference of such lists.

/// A stretch of a ray inside a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Ray parameter where the stretch begins: a crossing, or `t_min` of a ray that starts inside.
    pub t_in: f64,
    /// Ray parameter where it ends: a crossing, or `t_max` of a ray that ends inside.
    pub t_out: f64,
}

/// How many rounding steps of the ray parameter two faces may be apart and still touch. Both are polished roots with an
/// error of a few steps each.
const TOUCHING_ULPS: f64 = 16.0;

/// Returns the largest gap between faces near `t` that counts as no gap; `reach` is the ray parameter at which rounding
/// of the origin shows (|origin| / |direction|).
pub(crate) fn touching_gap(t: f64, reach: f64) -> f64 {
    TOUCHING_ULPS * f64::EPSILON * (t.abs() + reach)
}

/// Writes the stretches that are in `a` and not in `b`; both lists are ordered and disjoint, as `Solid::intervals`
/// gives them.
///
/// The result is closed again: stretches of zero length are dropped, so that the difference of equal solids is empty.
pub fn difference(a: &[Interval], b: &[Interval], out: &mut Vec<Interval>) {
    out.clear();
    for &Interval { t_in: a_in, t_out } in a {
        let mut t_in = a_in;
        for hole in b.iter().filter(|hole| hole.t_out > a_in && hole.t_in < t_out) {
            if hole.t_in > t_in {
                out.push(Interval { t_in, t_out: hole.t_in });
            }
            t_in = hole.t_out;
        }
        if t_in < t_out {
            out.push(Interval { t_in, t_out });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(ends: &[(f64, f64)]) -> Vec<Interval> {
        ends.iter().map(|&(t_in, t_out)| Interval { t_in, t_out }).collect()
    }

    #[test]
    fn difference_cuts_holes() {
        let mut out = Vec::new();
        let a = list(&[(0.0, 10.0), (20.0, 30.0)]);
        difference(&a, &list(&[(-1.0, 1.0), (2.0, 3.0), (9.0, 25.0)]), &mut out);
        assert_eq!(out, list(&[(1.0, 2.0), (3.0, 9.0), (25.0, 30.0)]), "what is left lies between the holes");
        difference(&a, &a, &mut out);
        assert_eq!(out, [], "equal solids leave nothing");
    }
}
