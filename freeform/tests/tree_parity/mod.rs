//! Trees of set operations: what the crate finds is what an oracle finds, and where.
//!
//! Of sets that is a plain sweep over the crossings of the parts, of which each is known between two numbers; of
//! blends, which have no crossings of parts, ranges of the tree's own function. Every ray is also traced through the
//! tree at another scale (a power of two) and far from the origin, where it must find the same.

use freeform::{FreeForm, Perturbation, Psi, Quadric, Ray, Solid};
use glam::DVec3;

use super::oracle::tree::RawTree;
use super::oracle::{Counted, RawForm, RawRay, blend, interval};
use super::{Random, found, number, on_all_threads, random_body, random_form, random_named, random_ray, ray_of};

const RAYS_A_TREE: u64 = 20;
/// Coordinates of rays are multiples of this, so that they can be moved without rounding.
const GRID: f64 = 1.0 / (1 << 30) as f64;
/// Coefficients may be off by this share.
const SPREAD: f64 = 1e-13;
/// So far from the origin by this one, for rays there are rounded to 10^-12 of the size, and the crate allows for some
/// such roundings.
const FAR_SPREAD: f64 = 1e-9;
/// The crate takes crossings for touching that are less apart than this.
const APART: f64 = 1e-10;
/// Found crossings are this near to where they are bracketed. A ray that lies in a surface but for rounding, as along a
/// line of a cone, has wider brackets.
const NEAR: f64 = 1e-9;

/// Crossings of a ray, and between which ray parameters each of them is.
type Found = (Counted, Vec<(f64, f64)>);

/// Returns what a sweep finds, `None` where crossings of different forms cannot be told apart or a form's are not
/// settled.
fn swept(tree: &RawTree, forms: &[RawForm], ray: &RawRay, spread: f64) -> Option<Found> {
    let (mut events, mut inside, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    let mut found = Vec::new();
    for (index, form) in forms.iter().enumerate() {
        let counted = interval::find(form, ray, spread, &mut found)?;
        inside.push(counted.starts_inside);
        ends.push(counted.ends_inside);
        events.extend(found.iter().map(|(lo, hi)| (*lo, *hi, index)));
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    if events.windows(2).any(|pair| pair[0].1 + APART >= pair[1].0) || events.iter().any(|(lo, hi, _)| hi - lo > NEAR) {
        return None;
    }
    let starts_inside = tree.holds(&inside);
    let (mut now, mut places) = (starts_inside, Vec::new());
    for (lo, hi, form) in events {
        inside[form] = !inside[form];
        let next = tree.holds(&inside);
        if next != now {
            places.push((lo, hi));
        }
        now = next;
    }
    assert_eq!(inside, ends, "the sweep ends where the forms do");
    let crossings = i32::try_from(places.len()).expect("few");
    Some((Counted { crossings, starts_inside, ends_inside: now }, places))
}

/// Returns what ranges of the tree's function find, `None` where they do not settle it.
fn ranged(tree: &RawTree, forms: &[RawForm], ray: &RawRay, spread: f64) -> Option<Found> {
    let mut places = Vec::new();
    let counted = blend::find(tree, forms, ray, spread, &mut places)?;
    let apart = places.windows(2).all(|pair| pair[0].1 + APART < pair[1].0);
    (apart && places.iter().all(|(lo, hi)| hi - lo < NEAR)).then_some((counted, places))
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

/// What came of many rays.
#[derive(Debug, Default)]
struct Tally {
    settled: u64,
    open: u64,
    /// Settled here, but not where rays are rounded more.
    open_far: u64,
    crossings: i64,
    most: i32,
}

impl Tally {
    fn join(self, other: Self) -> Self {
        Self {
            settled: self.settled + other.settled,
            open: self.open + other.open,
            open_far: self.open_far + other.open_far,
            crossings: self.crossings + other.crossings,
            most: self.most.max(other.most),
        }
    }

    /// Counts the rays of one tree.
    fn tree(&mut self, index: u64, kind: Kind) {
        let mut random = Random(index.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ kind as u64);
        let count = 1 + random.below(6);
        let draw = [random_form, random_body, random_named][random.below(3)];
        let raw: Vec<RawForm> = (0..count)
            .map(|_| {
                let mut form = draw(&mut random);
                form.perturbations.truncate(3);
                form
            })
            .collect();
        let forms: Vec<FreeForm> = raw.iter().map(|form| placed(form, 0, DVec3::ZERO)).collect();
        let (mut seed, width) = (Random(random.bits()), 0.05 + 0.4 * (1.0 + random.signed()));
        let mut psi = || match (kind, seed.below(4)) {
            (Kind::Sets, 0 | 1) | (Kind::Blends, 0) => Psi::Maximum,
            (Kind::Sets, _) | (Kind::Blends, 1) => Psi::RFunction,
            (Kind::Blends, _) => Psi::Blend { width },
        };
        let tree = RawTree::random(count, kind.depth(), &mut |n| random.below(n), &mut psi);
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
            let here = found(&solid, &ray_of(&ray));
            let size = 2_f64.powi(k);
            let there = found(&moved, &Ray::new(size * o + far, size * d).between(ray.t_min, ray.t_max));
            let settle = |spread: f64| match kind {
                Kind::Sets => swept(&tree, &raw, &ray, spread),
                Kind::Blends => ranged(&tree, &raw, &ray, spread),
            };
            self.crossings += i64::from(here.0.crossings);
            self.most = self.most.max(here.0.crossings);
            let Some((counted, places)) = settle(SPREAD) else {
                self.open += 1;
                continue;
            };
            self.settled += 1;
            assert!(
                agree(&here, &(counted, &places)),
                "tree {index}: {ray:?}: {here:?}, not {counted:?} in {places:?}"
            );
            if !agree(&there, &(counted, &places)) {
                assert!(
                    settle(FAR_SPREAD).is_none(),
                    "tree {index}, scaled by 2^{k} and moved: {ray:?}: {there:?}, not {counted:?} in {places:?}"
                );
                self.open_far += 1;
            }
        }
    }
}

/// Whether what the crate finds is what is settled.
fn agree(found: &(Counted, Vec<f64>), settled: &(Counted, &Vec<(f64, f64)>)) -> bool {
    let is_near = |(t, (lo, hi)): (&f64, &(f64, f64))| *t > lo - NEAR && *t < hi + NEAR;
    found.0 == settled.0 && found.1.iter().zip(settled.1).all(is_near)
}

/// What trees are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// Maximum and R-function, which make the same sets.
    Sets,
    /// Blends in half of the operations, and the others in the rest.
    Blends,
}

impl Kind {
    /// Operations above each other. Ranges grow with each of them, so blends have fewer.
    fn depth(self) -> usize {
        match self {
            Self::Sets => 4,
            Self::Blends => 3,
        }
    }
}

#[expect(clippy::print_stderr, reason = "the counts are the result; the test harness shows them on request")]
fn assert_parity(kind: Kind) {
    let rays = number("FREEFORM_PARITY_RAYS").unwrap_or(20_000);
    let trees = 0..rays.div_ceil(RAYS_A_TREE);
    let tally = on_all_threads(trees, |tally: &mut Tally, index| tally.tree(index, kind), Tally::join);
    eprintln!("{rays} rays through trees of {kind:?}: {tally:?}");
    assert!(tally.settled * 10 > rays * 7, "{} of {rays} rays are settled", tally.settled);
    assert!(tally.open_far * 1000 < rays, "{} of {rays} rays differ from afar", tally.open_far);
}

#[test]
fn trees_match_a_sweep_over_their_parts() {
    assert_parity(Kind::Sets);
}

#[test]
fn blends_match_ranges_of_their_function() {
    assert_parity(Kind::Blends);
}

#[test]
fn rays_that_used_up_their_stretches_once_are_settled() {
    // Rounding hid the sign for 10^-8 of a ray, in more stretches than a ray may have, and the crossing behind was put
    // half a metre off.
    let mut tally = Tally::default();
    tally.tree(11_583, Kind::Blends);
    assert!(tally.settled > 10, "{tally:?}");
}
