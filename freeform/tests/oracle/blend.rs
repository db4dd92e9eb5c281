//! Crossings of a ray with a tree of any psi, for all forms whose coefficients differ by a relative share: by ranges of
//! the tree's function and of its slope on stretches that are halved, all of it written anew from the definitions of
//! psi. Silent where that does not settle it.

use freeform::{Operation, Psi};

use super::interval::{Quadratic, Range, along, at, narrow, shifted};
use super::tree::RawTree;
use super::{Counted, RawForm, RawRay};

/// Values on a stretch, and slopes.
#[derive(Clone, Copy)]
struct Graph {
    value: Range,
    slope: Range,
}

/// The quadrics of a form along the ray.
struct Leaf {
    base: Quadratic,
    bumps: Vec<(Quadratic, Range)>,
}

impl Leaf {
    fn new(form: &RawForm, ray: &RawRay, spread: f64) -> Self {
        let bumps = form.perturbations.iter().map(|(q, f)| (along(q, ray, spread), Range::about(*f, spread)));
        Self { base: along(&form.base, ray, spread), bumps: bumps.collect() }
    }

    /// Returns what the form does within `h` of `m`.
    fn about(&self, m: f64, h: Range) -> Graph {
        let graph = |q: &Quadratic| {
            let [c, b, a] = shifted(*q, m);
            Graph { value: at([c, b, a], h), slope: b + (a + a) * h }
        };
        self.bumps.iter().fold(graph(&self.base), |sum, (q, factor)| {
            let q = graph(q);
            let positive = q.value.positive_part();
            let square = positive.square();
            let three = Range::exactly(3.0);
            Graph {
                value: sum.value + *factor * (square * positive),
                slope: sum.slope + *factor * (three * square * q.slope),
            }
        })
    }
}

impl Graph {
    fn negative(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }

    /// Returns psi of two. Psi rises with both, so its ends are those of ends; its slope is a sum of theirs, by shares
    /// that are functions of their values.
    fn union(psi: Psi, f: Self, g: Self) -> Self {
        let (value, shares) = match psi {
            Psi::Maximum => {
                let share = |f: Range, g: Range| match (f - g).sign() {
                    Some(1) => Range::exactly(1.0),
                    Some(_) => Range::exactly(0.0),
                    None => Range { lo: 0.0, hi: 1.0 },
                };
                let value = Range { lo: f.value.lo.max(g.value.lo), hi: f.value.hi.max(g.value.hi) };
                (value, [share(f.value, g.value), share(g.value, f.value)])
            }
            Psi::RFunction => {
                let root = |f: f64, g: f64| (Range::exactly(f).square() + Range::exactly(g).square()).sqrt();
                let end = |f: f64, g: f64| Range::exactly(f) + Range::exactly(g) + root(f, g);
                let value = Range { lo: end(f.value.lo, g.value.lo).lo, hi: end(f.value.hi, g.value.hi).hi };
                let root = (f.value.square() + g.value.square()).sqrt();
                let share = |f: Range| match root.sign() {
                    Some(1) => {
                        let sum = Range::exactly(1.0) + f.over(root);
                        Range { lo: sum.lo.max(0.0), hi: sum.hi.min(2.0) }
                    }
                    _ => Range { lo: 0.0, hi: 2.0 },
                };
                (value, [share(f.value), share(g.value)])
            }
            Psi::Blend { width } => {
                let (one, w) = (Range::exactly(1.0), Range::exactly(width));
                // How far the two are from being so different that they are not blended: 1 where they are equal.
                let near = |d: f64| (one - Range::exactly(d.abs()).over(w)).positive_part();
                let end = |f: f64, g: f64| {
                    let d = Range::exactly(f) - Range::exactly(g);
                    let least = if d.sign().is_some() { d.lo.abs().min(d.hi.abs()) } else { 0.0 };
                    let h = Range { lo: near(d.lo.abs().max(d.hi.abs())).lo, hi: near(least).hi };
                    Range::exactly(f.max(g)) + w.over(Range::exactly(6.0)) * (h.square() * h)
                };
                let value = Range { lo: end(f.value.lo, g.value.lo).lo, hi: end(f.value.hi, g.value.hi).hi };
                // Rises with f - g from 0 to 1.
                let share_at = |d: f64| {
                    let less = near(d).square().over(Range::exactly(2.0));
                    if d < 0.0 { less } else { one - less }
                };
                let share = |f: Range, g: Range| {
                    let d = f - g;
                    Range { lo: share_at(d.lo).lo, hi: share_at(d.hi).hi }
                };
                (value, [share(f.value, g.value), share(g.value, f.value)])
            }
        };
        Self { value, slope: shares[0] * f.slope + shares[1] * g.slope }
    }
}

fn about(tree: &RawTree, leaves: &[Leaf], m: f64, h: Range) -> Graph {
    let (operation, psi, parts) = match tree {
        RawTree::Leaf(form) => return leaves[*form].about(m, h),
        RawTree::Node(operation, psi, parts) => (*operation, *psi, parts),
    };
    let mut parts = parts.iter().map(|part| about(part, leaves, m, h));
    let first = parts.next().expect("an operation has parts");
    match operation {
        Operation::Union => parts.fold(first, |sum, part| Graph::union(psi, sum, part)),
        Operation::Intersection => {
            parts.fold(first, |sum, part| Graph::union(psi, sum.negative(), part.negative()).negative())
        }
        Operation::Difference => parts.fold(first, |sum, part| Graph::union(psi, sum.negative(), part).negative()),
        Operation::Complement => first.negative(),
    }
}

/// Returns the crossings and the sides of both ends of a finite ray where all forms agree; writes between which ray
/// parameters each crossing is.
pub(crate) fn find(
    tree: &RawTree,
    forms: &[RawForm],
    ray: &RawRay,
    spread: f64,
    found: &mut Vec<(f64, f64)>,
) -> Option<Counted> {
    found.clear();
    let leaves: Vec<Leaf> = forms.iter().map(|form| Leaf::new(form, ray, spread)).collect();
    let graph = |m: f64, h: Range| about(tree, &leaves, m, h);
    let side = |t: f64| graph(t, Range::exactly(0.0)).value.sign();
    let (start, stop) = (side(ray.t_min)?, side(ray.t_max)?);
    isolate(&graph, (ray.t_min, ray.t_max), 0, found)?;
    for (lo, hi) in &mut *found {
        narrow(&|t: Range| graph(0.5 * (t.lo + t.hi), Range::exactly(0.0)).value, lo, hi);
    }
    assert_eq!(found.len() % 2 == 1, start != stop, "crossings and sides belong together");
    let crossings = i32::try_from(found.len()).expect("few");
    Some(Counted { crossings, starts_inside: start > 0, ends_inside: stop > 0 })
}

fn isolate(
    graph: &impl Fn(f64, Range) -> Graph,
    (lo, hi): (f64, f64),
    depth: u32,
    found: &mut Vec<(f64, f64)>,
) -> Option<()> {
    let m = 0.5 * (lo + hi);
    let radius = (m - lo).max(hi - m).next_up();
    let h = Range { lo: -radius, hi: radius };
    let Graph { value, slope } = graph(m, h);
    let point = |t: f64| graph(t, Range::exactly(0.0)).value;
    if value.sign().is_some() || (point(m) + slope * h).sign().is_some() {
        return Some(());
    }
    if slope.sign().is_some() {
        if point(lo).sign()? != point(hi).sign()? {
            found.push((lo, hi));
        }
        return Some(());
    }
    if depth > 40 {
        return None;
    }
    isolate(graph, (lo, m), depth + 1, found)?;
    isolate(graph, (m, hi), depth + 1, found)
}
