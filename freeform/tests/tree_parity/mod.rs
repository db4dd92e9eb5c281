//! Trees of set operations: what the crate finds is what a plain sweep over the crossings of the parts finds, of which each is known between two numbers.
//!
//! Every ray is also traced through the tree at another scale (a power of two) and far from the origin, where it must find the same.

use freeform::{FreeForm, Operation, Perturbation, Psi, Quadric, Ray, Solid};
use glam::DVec3;

use super::oracle::{Counted, RawForm, RawRay, interval};
use super::{Random, random_form, random_ray};

const RAYS_A_TREE: u64 = 20;
/// Coordinates of rays are multiples of this, so that they can be moved without rounding.
const GRID: f64 = 1.0 / (1 << 30) as f64;

/// A tree over numbered forms; one form may stand in several places.
enum RawTree {
    Leaf(usize),
    Node(Operation, Vec<Self>),
}

impl RawTree {
    fn random(random: &mut Random, forms: usize, depth: usize) -> Self {
        if depth == 0 || random.below(4) == 0 {
            return Self::Leaf(random.below(forms));
        }
        let operation =
            [Operation::Union, Operation::Intersection, Operation::Difference, Operation::Complement][random.below(4)];
        let parts = if operation == Operation::Complement { 1 } else { 2 + random.below(2) };
        Self::Node(operation, (0..parts).map(|_| Self::random(random, forms, depth - 1)).collect())
    }

    fn solid(&self, forms: &[FreeForm]) -> Solid {
        match self {
            Self::Leaf(form) => forms[*form].clone().into(),
            Self::Node(operation, parts) => {
                let parts = parts.iter().map(|part| part.solid(forms)).collect();
                Solid::join(*operation, Psi::Maximum, parts).expect("sound")
            }
        }
    }

    fn holds(&self, inside: &[bool]) -> bool {
        let mut parts = match self {
            Self::Leaf(form) => return inside[*form],
            Self::Node(_, parts) => parts.iter().map(|part| part.holds(inside)),
        };
        match self {
            Self::Leaf(_) | Self::Node(Operation::Union, _) => parts.any(|part| part),
            Self::Node(Operation::Intersection, _) => parts.all(|part| part),
            Self::Node(Operation::Difference, _) => parts.next() == Some(true) && !parts.any(|part| part),
            Self::Node(Operation::Complement, _) => parts.next() == Some(false),
        }
    }
}

/// Returns what a sweep finds, `None` where crossings of different forms cannot be told apart or a form's are not settled.
fn swept(tree: &RawTree, forms: &[RawForm], ray: &RawRay) -> Option<Counted> {
    let (mut events, mut inside, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    let mut found = Vec::new();
    for (index, form) in forms.iter().enumerate() {
        let counted = interval::find(form, ray, 1e-14, &mut found)?;
        inside.push(counted.starts_inside);
        ends.push(counted.ends_inside);
        events.extend(found.iter().map(|(lo, hi)| (*lo, *hi, index)));
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Further apart than what the crate takes for touching.
    if events.windows(2).any(|pair| pair[0].1 + 1e-10 >= pair[1].0) {
        return None;
    }
    let starts_inside = tree.holds(&inside);
    let (mut now, mut crossings) = (starts_inside, 0);
    for (_, _, form) in events {
        inside[form] = !inside[form];
        let next = tree.holds(&inside);
        crossings += i32::from(next != now);
        now = next;
    }
    assert_eq!(inside, ends, "the sweep ends where the forms do");
    Some(Counted { crossings, starts_inside, ends_inside: now })
}

/// Returns what the crate finds.
fn found(solid: &Solid, ray: &Ray) -> Counted {
    let mut inside = Vec::new();
    solid.intervals(ray, &mut inside);
    let ends: Vec<f64> =
        inside.iter().flat_map(|i| [i.t_in, i.t_out]).filter(|t| *t > ray.t_min && *t < ray.t_max).collect();
    let first = solid.first_hit(ray);
    assert_eq!(first.map(|c| c.t), ends.first().copied(), "the first hit is the first crossing");
    Counted {
        crossings: i32::try_from(ends.len()).expect("few"),
        starts_inside: inside.first().is_some_and(|i| i.t_in == ray.t_min),
        ends_inside: inside.last().is_some_and(|i| i.t_out == ray.t_max),
    }
}

/// Returns the form scaled by 2^k, without rounding, about `origin`.
fn placed(raw: &RawForm, k: i32, origin: DVec3) -> FreeForm {
    let quadric = |c: &[f64; 10]| {
        let power = |index: usize| [-2 * k, -k, 0][usize::from(index >= 6) + usize::from(index == 9)];
        Quadric::new(std::array::from_fn(|index| c[index] * 2_f64.powi(power(index)))).expect("finite, not zero")
    };
    let perturbations = raw.perturbations.iter().map(|(q, f)| Perturbation { quadric: quadric(q), factor: *f });
    FreeForm::with_origin(origin, quadric(&raw.base), perturbations.collect()).expect("sound")
}

#[test]
#[expect(clippy::print_stderr, reason = "the counts are the result; the test harness shows them on request")]
fn trees_match_a_sweep_over_their_parts() {
    let rays: u64 = std::env::var("FREEFORM_PARITY_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let threads = std::thread::available_parallelism().map_or(1, |n| u64::try_from(n.get()).expect("few"));
    let trees = rays.div_ceil(RAYS_A_TREE);
    let (settled, open, crossings, most) = std::thread::scope(|scope| {
        let run = |first: u64| {
            move || {
                let mut sum = (0_u64, 0_u64, 0_i64, 0);
                (first..trees).step_by(usize::try_from(threads).expect("few")).for_each(|index| tree(index, &mut sum));
                sum
            }
        };
        let workers: Vec<_> = (0..threads).map(|first| scope.spawn(run(first))).collect();
        let sums = workers.into_iter().map(|worker| worker.join().expect("no panic"));
        sums.fold((0, 0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3.max(b.3)))
    });
    eprintln!(
        "{rays} rays through trees, {settled} settled, {open} open, {crossings} crossings, at most {most} on one"
    );
    assert!(settled * 10 > rays * 7, "{settled} of {rays} rays are settled");
}

/// Counts the rays of one tree: settled, open, crossings, and the most on one ray.
fn tree(index: u64, sum: &mut (u64, u64, i64, i32)) {
    let mut random = Random(index.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x7c15);
    let count = 1 + random.below(6);
    let raw: Vec<RawForm> = (0..count)
        .map(|_| {
            let mut form = random_form(&mut random);
            form.perturbations.truncate(3);
            form
        })
        .collect();
    let forms: Vec<FreeForm> = raw.iter().map(|form| placed(form, 0, DVec3::ZERO)).collect();
    let tree = RawTree::random(&mut random, count, 4);
    let solid = tree.solid(&forms);
    let k = i32::try_from(random.below(41)).expect("small") - 20;
    let far = 8192.0 * 2_f64.powi(k) * DVec3::new(1.0, -2.0, 0.5);
    let moved: Vec<FreeForm> = raw.iter().map(|form| placed(form, k, far)).collect();
    let moved = tree.solid(&moved);
    for _ in 0..RAYS_A_TREE {
        let form = random.below(count);
        let mut ray = random_ray(&mut random, &forms[form], &Solid::from(forms[form].clone()));
        ray.origin = ray.origin.map(|x| (x / GRID).round() * GRID);
        (ray.t_min, ray.t_max) = (ray.t_min.max(-9.0), ray.t_max.min(9.0));
        let (o, d) = (DVec3::from_array(ray.origin), DVec3::from_array(ray.direction));
        let here = found(&solid, &Ray::new(o, d).between(ray.t_min, ray.t_max));
        let size = 2_f64.powi(k);
        let there = found(&moved, &Ray::new(size * o + far, size * d).between(ray.t_min, ray.t_max));
        for counted in [here, there] {
            let differ = counted.starts_inside != counted.ends_inside;
            assert_eq!(counted.crossings % 2 == 1, differ, "tree {index}: {ray:?}: {counted:?}");
        }
        match swept(&tree, &raw, &ray) {
            None => sum.1 += 1,
            Some(counted) => {
                assert_eq!(here, counted, "tree {index}: {ray:?}");
                assert_eq!(there, counted, "tree {index}, scaled by 2^{k} and moved: {ray:?}");
                sum.0 += 1;
            }
        }
        sum.2 += i64::from(here.crossings);
        sum.3 = sum.3.max(here.crossings);
    }
}
