//! Crossings of a ray with a free form counted in exact arithmetic.

use std::cmp::Ordering;

use num_bigint::BigInt;
use num_traits::{Signed, Zero};

use super::dyadic::{Dyadic, Polynomial, Sturm, add, multiply, to_integers, value};
use super::{Counted, RawForm, RawRay};

/// Bits after the point in the enclosures of breaks; the second where the first leave it open. Twice the bits take
/// twice the time, and 72 are enough for nearly all rays.
const BREAK_BITS: [i64; 2] = [72, 160];

/// Returns the number of crossings and the sides of both ends; `None` where a root lies within 2^-160 of a break or an
/// end, or two breaks do of each other.
pub(crate) fn count(form: &RawForm, ray: &RawRay) -> Option<Counted> {
    BREAK_BITS.into_iter().find_map(|bits| count_with(form, ray, bits))
}

/// Returns the same with breaks enclosed to so many bits.
fn count_with(form: &RawForm, ray: &RawRay, break_bits: i64) -> Option<Counted> {
    let base = along(&form.base, ray);
    let bumps: Vec<(Polynomial, Dyadic)> =
        form.perturbations.iter().filter(|(_, f)| *f != 0.0).map(|(q, f)| (along(q, ray), Dyadic::from(*f))).collect();

    // Ends of pieces, each an enclosure.
    let mut breaks = Vec::new();
    for (q, _) in &bumps {
        for (lo, hi) in roots(q, break_bits) {
            match (compare(&hi, &ray.lo()), compare(&lo, &ray.hi())) {
                (Ordering::Less, _) | (_, Ordering::Greater) => continue,
                _ if lo.compare(&ray.lo()) != Ordering::Greater || hi.compare(&ray.hi()) != Ordering::Less => {
                    return None;
                }
                _ => breaks.push((lo, hi)),
            }
        }
    }
    breaks.push((ray.lo(), ray.lo()));
    breaks.push((ray.hi(), ray.hi()));
    breaks.sort_by(|a, b| a.0.compare(&b.0));

    let mut counted = Counted { crossings: 0, starts_inside: false, ends_inside: false };
    for (index, pair) in breaks.windows(2).enumerate() {
        let [(a0, a1), (b0, b1)] = pair else { unreachable!("windows of two") };
        if a1.compare(b0) != Ordering::Less {
            return None;
        }
        let middle = (a1 + b0).half();
        let mut p = base.clone();
        for (q, f) in &bumps {
            if value(q, &middle).sign() > 0 {
                let cube = multiply(&multiply(q, q), q);
                p = add(&p, &cube.iter().map(|c| c * f).collect::<Vec<_>>());
            }
        }
        if index == 0 {
            counted.starts_inside = side(&p, a0)?;
        }
        if index + 2 == breaks.len() {
            counted.ends_inside = side(&p, b1)?;
        }
        let (outer, inner) = (roots_between(&p, a0, b1, 0)?, value(&p, a1).sign() * value(&p, b0).sign());
        // No root may hide in the enclosures: one more or less would show in the signs, two in Sturm's count.
        if (outer % 2 == 1) != (inner < 0) {
            return None;
        }
        counted.crossings += outer;
    }
    Some(counted)
}

/// Returns the number of roots in (a, b): by exact Bernstein signs where they settle it after some halvings, else by
/// Sturm's chain. `None` where a cut is a root.
fn roots_between(p: &[Dyadic], a: &Dyadic, b: &Dyadic, depth: u32) -> Option<i32> {
    const HALVINGS: u32 = 12;
    match variations_on(p, a, b) {
        few @ (0 | 1) => Some(few),
        _ if depth == HALVINGS => {
            let sturm = Sturm::new(p);
            Some(sturm.variations(a) - sturm.variations(b))
        }
        _ => {
            let middle = (a + b).half();
            side(p, &middle)?;
            Some(roots_between(p, a, &middle, depth + 1)? + roots_between(p, &middle, b, depth + 1)?)
        }
    }
}

fn compare(a: &Dyadic, b: &Dyadic) -> Ordering {
    a.compare(b)
}

fn side(p: &[Dyadic], t: &Dyadic) -> Option<bool> {
    let sign = value(p, t).sign();
    (sign != 0).then_some(sign > 0)
}

/// Returns Q(o + t d) as a polynomial in t.
fn along(q: &[f64; 10], ray: &RawRay) -> Polynomial {
    let line: Vec<Polynomial> =
        (0..3).map(|k| vec![Dyadic::from(ray.origin[k]), Dyadic::from(ray.direction[k])]).collect();
    let one = vec![Dyadic::from(1.0)];
    let (x, y, z) = (&line[0], &line[1], &line[2]);
    let monomials = [(x, x), (y, y), (z, z), (x, y), (x, z), (y, z), (x, &one), (y, &one), (z, &one), (&one, &one)];
    let mut sum = vec![Dyadic::zero(); 3];
    for ((a, b), c) in monomials.into_iter().zip(q) {
        let c = Dyadic::from(*c);
        sum = add(&sum, &multiply(a, b).iter().map(|m| m * &c).collect::<Vec<_>>());
    }
    sum
}

/// Returns enclosures of the roots of a polynomial of degree two or less at which its sign changes.
fn roots(q: &[Dyadic], break_bits: i64) -> Vec<(Dyadic, Dyadic)> {
    let integers = to_integers(q);
    let enclose = |numerator: BigInt, denominator: BigInt| {
        let (n, d) = if denominator.is_negative() { (-numerator, -denominator) } else { (numerator, denominator) };
        let quotient = (n << break_bits) / d;
        let end = |offset: i32| Dyadic { mantissa: &quotient + offset, exponent: -break_bits };
        (end(-2), end(2))
    };
    match &integers[..] {
        [c, b] => vec![enclose(-c, b.clone())],
        [c, b, a] => {
            let discriminant: BigInt = b * b - BigInt::from(4) * a * c;
            if !discriminant.is_positive() {
                return Vec::new();
            }
            // The root is right to one unit after so many further bits, far below the width of the enclosure.
            let bits = 2 * usize::try_from(break_bits).expect("positive");
            let root = (discriminant << (2 * bits)).sqrt();
            let (b, a) = (b << bits, a << bits);
            let mut both = vec![enclose(-&b - &root, 2 * &a), enclose(-&b + &root, 2 * &a)];
            if a.is_negative() {
                both.reverse();
            }
            both
        }
        _ => Vec::new(),
    }
}

/// Returns the sign variations of the Bernstein coefficients on [a, b]: exact, so 0 and 1 are the number of roots.
fn variations_on(p: &[Dyadic], a: &Dyadic, b: &Dyadic) -> i32 {
    // p(a + (b - a) u), then (1 + u)^n p(u / (1 + u)): the scaled Bernstein coefficients.
    let width = b - a;
    let n = p.len() - 1;
    let mut q: Vec<Dyadic> = p.to_vec();
    for i in 0..n {
        for k in (i..n).rev() {
            q[k] = &q[k] + &(&q[k + 1] * a);
        }
    }
    let mut power = Dyadic::from(1.0);
    for c in &mut q {
        *c = &*c * &power;
        power = &power * &width;
    }
    q.reverse();
    for i in 0..n {
        for k in (i..n).rev() {
            q[k] = &q[k] + &q[k + 1];
        }
    }
    let signs: Vec<i32> = q.iter().map(Dyadic::sign).filter(|s| *s != 0).collect();
    let changes = signs.windows(2).filter(|pair| pair[0] != pair[1]).count();
    debug_assert!(q.iter().all(|c| c.mantissa.is_zero() || c.sign() != 0), "zero has no sign");
    i32::try_from(changes).expect("at most six")
}
