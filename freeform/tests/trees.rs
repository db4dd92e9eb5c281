//! Trees of set operations: the same sets as Boolean algebra, in points and along rays; text and files; what is
//! refused.

use freeform::{Bounds, DEPTH_LIMIT, FormError, FreeForm, Interval, Operation, Perturbation, Psi, Quadric, Ray, Solid};
use glam::{DAffine3, DVec3};
use proptest::prelude::*;

fn ball(center: DVec3, radius: f64) -> Solid {
    FreeForm::new(Quadric::sphere(center, radius).expect("a ball"), vec![]).expect("sound").into()
}

fn slab(at: DVec3, normal: DVec3, half: f64) -> Solid {
    FreeForm::new(Quadric::slab(at, normal, half).expect("a slab"), vec![]).expect("sound").into()
}

fn intervals(solid: &Solid, ray: &Ray) -> Vec<Interval> {
    let mut out = Vec::new();
    solid.intervals(ray, &mut out);
    out
}

/// A tree as a test sees it.
#[derive(Debug, Clone)]
enum Tree {
    Leaf(Box<FreeForm>),
    Node(Operation, Vec<Self>),
}

impl Tree {
    fn solid(&self, psi: Psi) -> Solid {
        match self {
            Self::Leaf(form) => Solid::from(form.as_ref().clone()),
            Self::Node(operation, parts) => {
                Solid::join(*operation, psi, parts.iter().map(|part| part.solid(psi)).collect()).expect("sound")
            }
        }
    }

    fn holds(&self, p: DVec3) -> bool {
        match self {
            Self::Leaf(form) => form.value(p) >= 0.0,
            Self::Node(Operation::Union, parts) => parts.iter().any(|part| part.holds(p)),
            Self::Node(Operation::Intersection, parts) => parts.iter().all(|part| part.holds(p)),
            Self::Node(Operation::Difference, parts) => {
                parts[0].holds(p) && !parts[1..].iter().any(|part| part.holds(p))
            }
            Self::Node(Operation::Complement, parts) => !parts[0].holds(p),
        }
    }
}

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    [-size..size, -size..size, -size..size].prop_map(DVec3::from_array)
}

fn leaf() -> impl Strategy<Value = Tree> {
    let ellipsoid = |at: f64| {
        (vector(at), vector(0.4))
            .prop_map(|(c, r)| Quadric::ellipsoid(c, r + DVec3::splat(0.6)).expect("positive radii"))
    };
    let perturbation = (ellipsoid(1.0), -1.0..1.0).prop_map(|(quadric, factor)| Perturbation { quadric, factor });
    let form = (ellipsoid(1.0), prop::collection::vec(perturbation, 0..3))
        .prop_map(|(base, p)| Tree::Leaf(Box::new(FreeForm::new(base, p).expect("sound"))));
    let plane = (vector(0.7), vector(1.0)).prop_map(|(p, n)| {
        Tree::Leaf(Box::new(
            FreeForm::new(Quadric::half_space(p, n + DVec3::Y * 1.5).expect("a direction"), vec![]).expect("sound"),
        ))
    });
    prop_oneof![4 => form, 1 => plane]
}

fn tree() -> impl Strategy<Value = Tree> {
    leaf().prop_recursive(4, 24, 4, |part| {
        let operation = prop_oneof![Just(Operation::Union), Just(Operation::Intersection), Just(Operation::Difference)];
        prop_oneof![
            6 => (operation, prop::collection::vec(part.clone(), 1..4)).prop_map(|(o, parts)| Tree::Node(o, parts)),
            1 => part.prop_map(|part| Tree::Node(Operation::Complement, vec![part])),
        ]
    })
}

proptest! {
    #[test]
    fn trees_are_boolean_algebra(tree in tree(), points in prop::collection::vec(vector(2.0), 500)) {
        for psi in [Psi::Maximum, Psi::RFunction] {
            let solid = tree.solid(psi);
            for &p in &points {
                let value = solid.value(p);
                prop_assert!((value >= 0.0) == tree.holds(p) || value.abs() < 1e-12, "{:?} at {}: {}", psi, p, value);
                match solid.bounds() {
                    Bounds::Finite { min, max } if value >= 0.0 => prop_assert!(p.cmpge(min).all() && p.cmple(max).all(), "{} outside of {} {}", p, min, max),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn rays_through_trees_agree_with_points(tree in tree(), origin in vector(3.0), aim in vector(1.0)) {
        let solid = tree.solid(Psi::Maximum);
        for ray in [Ray::new(origin, aim - origin), Ray::line(origin, aim - origin), Ray::new(origin, aim - origin).between(0.5, 1.2)] {
            let inside = intervals(&solid, &ray);
            let ends: Vec<f64> = inside.iter().flat_map(|i| [i.t_in, i.t_out]).collect();
            prop_assert!(ends.windows(2).all(|pair| pair[0] < pair[1]), "in order and apart: {:?}", ends);
            let first = ends.iter().copied().find(|t| *t > ray.t_min && *t < ray.t_max);
            let hit = solid.first_hit(&ray);
            prop_assert_eq!(hit.map(|c| c.t), first, "the first end of {:?}", inside);
            prop_assert_eq!(solid.any_hit(&ray), first.is_some(), "any hit");
            if let Some(hit) = hit {
                // On the surface, by the part that was hit and by the whole.
                let p = ray.at(hit.t);
                let (value, gradient) = solid.first_order(hit.part, p);
                prop_assert!(value.abs() < 1e-11 * (1.0 + gradient.length()), "value {} at {:?}", value, hit);
                prop_assert!(solid.value(p).abs() < 1e-11 * (1.0 + gradient.length()), "value {}", solid.value(p));
                let n = solid.normal_at(hit.part, p, ray.direction);
                prop_assert!(n.dot(ray.direction) * if hit.entering { -1.0 } else { 1.0 } > -1e-4, "{:?} turned to {}", hit, n);
            }
            for k in 0..60 {
                let t = -1.0 + f64::from(k) * 0.05;
                let near_end = ends.iter().any(|end| (end - t).abs() < 1e-9);
                if t > ray.t_min && t < ray.t_max && !near_end {
                    let within = inside.iter().any(|i| i.t_in <= t && t <= i.t_out);
                    prop_assert_eq!(within, tree.holds(ray.at(t)), "at {}: {:?}", t, inside);
                }
            }
        }
    }

    #[test]
    fn blends_are_found_where_they_are(tree in tree(), origin in vector(3.0), aim in vector(1.0), width in 0.05..0.8) {
        let solid = tree.solid(Psi::Blend { width });
        let ray = Ray::new(origin, aim - origin).between(0.0, 3.0);
        let inside = intervals(&solid, &ray);
        let ends: Vec<f64> = inside.iter().flat_map(|i| [i.t_in, i.t_out]).collect();
        prop_assert!(ends.windows(2).all(|pair| pair[0] < pair[1]), "in order and apart: {:?}", ends);
        let value = |t: f64| solid.value(ray.at(t));
        for &t in ends.iter().filter(|t| **t > 0.0 && **t < 3.0) {
            prop_assert!(value(t).abs() < 1e-11, "{} on the surface", value(t));
        }
        for k in 0..=300 {
            let t = 0.01 * f64::from(k);
            let within = inside.iter().any(|i| i.t_in <= t && t <= i.t_out);
            prop_assert!(within == (value(t) >= 0.0) || value(t).abs() < 1e-12, "at {}: {} in {:?}", t, value(t), inside);
        }
        if let Bounds::Finite { min, max } = solid.bounds() {
            for t in (0..300).map(|k| 0.01 * f64::from(k)).filter(|t| value(*t) >= 0.0) {
                prop_assert!(ray.at(t).cmpge(min).all() && ray.at(t).cmple(max).all(), "{} outside of {} {}", ray.at(t), min, max);
            }
        }
        prop_assert_eq!(solid.first_hit(&ray).map(|c| c.t), ends.iter().copied().find(|t| *t > 0.0 && *t < 3.0), "first of {:?}", ends);
    }

    #[test]
    fn text_and_files_are_read_back(tree in tree(), width in 1e-3..1.0) {
        for psi in [Psi::Maximum, Psi::RFunction, Psi::Blend { width }] {
            let solid = tree.solid(psi).transformed(&DAffine3::from_translation(DVec3::new(0.1, 1e-7, -3e5))).unwrap();
            let text = solid.to_string();
            prop_assert_eq!(&text.parse::<Solid>().unwrap(), &solid, "{}", text);
            let file = toml::to_string(&solid).unwrap();
            prop_assert_eq!(&toml::from_str::<Solid>(&file).unwrap(), &solid, "{}", file);
        }
    }
}

#[test]
fn what_is_taken_away_leaves_no_skin() {
    let whole = ball(DVec3::ZERO, 1.0);
    let nothing = Solid::difference(Psi::Maximum, vec![whole.clone(), whole.clone()]).unwrap();
    let all = Solid::union(Psi::Maximum, vec![whole.clone(), whole.clone().complement().unwrap()]).unwrap();
    // A half, made by a plane that is the face of another half.
    let half = |n: DVec3| FreeForm::new(Quadric::half_space(DVec3::ZERO, n).unwrap(), vec![]).unwrap().into();
    let upper = Solid::intersection(Psi::Maximum, vec![whole.clone(), half(-DVec3::Y)]).unwrap();
    let lower = Solid::intersection(Psi::Maximum, vec![whole.clone(), half(DVec3::Y)]).unwrap();
    let halves = Solid::union(Psi::RFunction, vec![upper, lower]).unwrap();
    for k in 0..500 {
        let angle = f64::from(k) * 0.37;
        let origin = DVec3::new(3.0 * angle.cos(), 2.0 * angle.sin(), 2.0 * (angle * 1.7).cos());
        let ray = Ray::new(origin, DVec3::new(0.3 * angle.sin(), 0.1, 0.2) - origin);
        assert_eq!(intervals(&nothing, &ray), [], "ray {k}: equal solids leave nothing");
        assert!(!nothing.any_hit(&ray), "ray {k}: nothing is hit");
        assert_eq!(intervals(&all, &ray), [Interval { t_in: 0.0, t_out: f64::INFINITY }], "ray {k}: all space");
        assert_eq!(intervals(&halves, &ray), intervals(&whole, &ray), "ray {k}: two halves are the whole");
    }
}

#[test]
fn turned_boxes_are_bounded() {
    // Each slab by itself is endless along every axis; together they have the box of the corners, also as a part and
    // far away.
    let cube = Solid::cuboid(DVec3::splat(-1.0), DVec3::new(1.0, 2.0, 1.0)).unwrap();
    let turn = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
    let place = DAffine3::from_translation(DVec3::new(0.0, 50.0, -1e4))
        * turn
        * DAffine3::from_scale(DVec3::new(1.0, 0.5, 2.0));
    let corners = (0..8).map(|k| DVec3::new([-1.0, 1.0][k & 1], [-1.0, 2.0][k >> 1 & 1], [-1.0, 1.0][k >> 2]));
    let corners: Vec<DVec3> = corners.map(|corner| place.transform_point3(corner)).collect();
    let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let turned = cube.transformed(&place).unwrap();
    let rod = Solid::from(FreeForm::new(Quadric::cylinder(DVec3::ZERO, DVec3::Y, 9.0).unwrap(), vec![]).unwrap());
    let clipped =
        rod.clone().clipped(DVec3::splat(-1.0), DVec3::new(1.0, 2.0, 1.0)).unwrap().transformed(&place).unwrap();
    let drilled =
        Solid::difference(Psi::Blend { width: 0.1 }, vec![turned.clone(), ball(place.translation, 0.4)]).unwrap();
    for (solid, what) in [(turned, "box"), (clipped, "clipped rod"), (drilled, "box with a hollow")] {
        let Bounds::Finite { min, max } = solid.bounds() else { panic!("a turned {what} is bounded") };
        assert!(min.cmple(low).all() && (low - min).max_element() < 1e-6, "{what}: {min}, not {low}");
        assert!(max.cmpge(high).all() && (max - high).max_element() < 1e-6, "{what}: {max}, not {high}");
    }
    let slab = |normal: DVec3| slab(DVec3::ONE, normal, 0.25);
    let two =
        Solid::intersection(Psi::Maximum, vec![slab(DVec3::new(1.0, 1.0, 0.0)), slab(DVec3::new(1.0, -1.0, 0.2))])
            .unwrap();
    assert_eq!(two.bounds(), Bounds::Unbounded, "two slabs leave a beam without ends");
    let near = vec![slab(DVec3::Y + DVec3::X), slab(DVec3::Y - DVec3::X), slab(DVec3::new(0.0, 1.0, 1e-6))];
    let near = Solid::intersection(Psi::Maximum, near).unwrap();
    assert_eq!(
        near.bounds(),
        Bounds::Unbounded,
        "three that nearly lie along a line have no box that rounding would not move"
    );
}

#[test]
fn operations_have_their_closed_forms() {
    let x = |t: f64| DVec3::X * t;
    let (a, b) = (ball(DVec3::ZERO, 1.0), ball(x(1.0), 1.0));
    let ray = Ray::new(x(-3.0), DVec3::X);
    let join = |operation, parts: &[&Solid]| {
        Solid::join(operation, Psi::Maximum, parts.iter().map(|part| (*part).clone()).collect()).unwrap()
    };
    let ends = |solid: &Solid| -> Vec<f64> { intervals(solid, &ray).iter().flat_map(|i| [i.t_in, i.t_out]).collect() };
    assert_eq!(ends(&join(Operation::Union, &[&a, &b])), [2.0, 5.0], "union");
    assert_eq!(ends(&join(Operation::Intersection, &[&a, &b])), [3.0, 4.0], "lens");
    assert_eq!(ends(&join(Operation::Difference, &[&a, &b])), [2.0, 3.0], "bitten");
    assert_eq!(ends(&join(Operation::Difference, &[&b, &a])), [4.0, 5.0], "bitten from the other side");
    assert_eq!(ends(&join(Operation::Complement, &[&a])), [0.0, 2.0, 4.0, f64::INFINITY], "room");
    let bitten = join(Operation::Difference, &[&a, &b]);
    let leaving = bitten.first_hit(&Ray::new(x(-0.5), DVec3::X)).unwrap();
    assert_eq!((leaving.t, leaving.entering, leaving.part), (0.5, false, 1), "the bite is the second part");
    let n = bitten.normal_at(1, x(0.0), DVec3::X);
    assert!((n - DVec3::X).length() < 1e-12, "and its normal points out of what is left: {n}");
    // A cube with a hole through it, from three slabs and a cylinder.
    let cube = Solid::cuboid(DVec3::splat(-1.0), DVec3::new(1.0, 2.0, 1.0)).unwrap();
    let hole = FreeForm::new(Quadric::cylinder(DVec3::ZERO, DVec3::Z, 0.5).unwrap(), vec![]).unwrap().into();
    let part = Solid::difference(Psi::Maximum, vec![cube.clone(), hole]).unwrap();
    assert_eq!(ends(&part), [2.0, 2.5, 3.5, 4.0], "through the hole");
    let Bounds::Finite { min, max } = part.bounds() else { panic!("a cube is bounded") };
    assert!(
        (min + DVec3::ONE).abs().max_element() < 1e-8 && (max - DVec3::new(1.0, 2.0, 1.0)).abs().max_element() < 1e-8,
        "{min} {max}"
    );
    // An endless cylinder ends where it is clipped.
    let rod: Solid = FreeForm::new(Quadric::cylinder(DVec3::ZERO, DVec3::X, 0.5).unwrap(), vec![]).unwrap().into();
    assert_eq!(rod.bounds(), Bounds::Unbounded, "a cylinder says so");
    let rod = rod.clipped(DVec3::splat(-2.0), DVec3::new(1.0, 1.0, 1.0)).unwrap();
    assert_eq!(ends(&rod), [1.0, 4.0], "clipped");
    let Bounds::Finite { min, max } = rod.bounds() else { panic!("bounded now") };
    assert!(
        (min - DVec3::new(-2.0, -0.5, -0.5)).abs().max_element() < 1e-8 && (max.x - 1.0).abs() < 1e-8,
        "{min} {max}"
    );
}

#[test]
fn a_blend_of_equal_slabs_has_its_closed_form() {
    // Where f = g the blend is f + w / 6, so that two equal slabs 1 - (x/h)^2 give one of half-width h sqrt(1 + w / 6).
    let w = 0.6;
    let two = vec![slab(DVec3::ZERO, DVec3::X, 0.5), slab(DVec3::ZERO, DVec3::X, 0.5)];
    let union = Solid::union(Psi::Blend { width: w }, two.clone()).unwrap();
    let common = Solid::intersection(Psi::Blend { width: w }, two).unwrap();
    for (solid, half) in [(union, 0.5 * (1.0 + w / 6.0).sqrt()), (common, 0.5 * (1.0 - w / 6.0).sqrt())] {
        for far in [3.0, 1e4] {
            let found = intervals(&solid, &Ray::new(DVec3::X * -far, DVec3::X));
            assert_eq!(found.len(), 1, "one stretch: {found:?}");
            let tolerance = 4.0 * f64::EPSILON * far;
            assert!(
                (found[0].t_in - (far - half)).abs() < tolerance && (found[0].t_out - (far + half)).abs() < tolerance,
                "{found:?}"
            );
        }
    }
}

#[test]
fn touches_of_a_blend_are_no_crossings() {
    // Along x the blend of two balls of radius 1 about (+-a, 0, 0) has its waist in the middle: a line across it at the
    // waist's height touches it.
    let w = 0.5;
    let parts = vec![ball(DVec3::X * -0.9, 1.0), ball(DVec3::X * 0.9, 1.0)];
    let solid = Solid::union(Psi::Blend { width: w }, parts).unwrap();
    let waist = (1.0 + w / 6.0 - 0.81_f64).sqrt();
    for (height, crossings) in [(waist * (1.0 - 1e-9), 1), (waist * (1.0 + 1e-9), 2)] {
        let found = intervals(&solid, &Ray::line(DVec3::Y * height, DVec3::X));
        assert_eq!(found.len(), crossings, "{height} of {waist}: {found:?}");
    }
    let apart = intervals(&solid, &Ray::line(DVec3::Y * waist, DVec3::X));
    assert!(apart.len() <= 2 && apart.iter().all(|i| i.t_out - i.t_in > 0.1), "at the waist itself: {apart:?}");
    // Restarts from hits: outwards nothing is hit at once, inwards the exit is found.
    for k in 0..200 {
        let angle = f64::from(k) * 0.17;
        let origin = DVec3::new(4.0 * angle.cos(), 3.0 * angle.sin(), 0.5 * (3.0 * angle).sin());
        let ray = Ray::new(origin, DVec3::new(angle.sin(), 0.1, 0.0) - origin);
        let Some(hit) = solid.first_hit(&ray) else { continue };
        let p = ray.at(hit.t);
        let n = solid.normal_at(hit.part, p, ray.direction);
        let out = solid.first_hit(&Ray::new(p, n));
        assert!(out.is_none_or(|c| c.entering && c.t > 1e-9), "outwards {out:?}");
        let back = solid.first_hit(&Ray::new(p, -n));
        assert!(back.is_some_and(|c| !c.entering && c.t > 1e-9), "inwards {back:?}");
    }
}

#[test]
fn trees_of_a_thousand_parts_are_those_of_their_parts() {
    let spot = |k: u32| {
        let angle = f64::from(k) * 2.4;
        let (y, r) = (1.0 - f64::from(k) / 500.0, 1.2);
        DVec3::new(r * angle.cos(), y, r * angle.sin())
    };
    let balls: Vec<Solid> = (0..1000).map(|k| ball(spot(k), 0.11)).collect();
    let flat = Solid::union(Psi::Maximum, balls.clone()).unwrap();
    let mut deep = balls.clone();
    while deep.len() > 1 {
        // Pairs in turn united and taken from the complement: the same set by De Morgan.
        deep = deep
            .chunks(2)
            .enumerate()
            .map(|(k, pair)| {
                let parts = pair.to_vec();
                if k % 2 == 0 {
                    return Solid::union(Psi::Maximum, parts).unwrap();
                }
                let outside = parts.into_iter().map(|part| part.complement().unwrap()).collect();
                Solid::intersection(Psi::Maximum, outside).unwrap().complement().unwrap()
            })
            .collect();
    }
    let bored = Solid::difference(Psi::Maximum, std::iter::once(ball(DVec3::ZERO, 1.2)).chain(balls.clone()).collect())
        .unwrap();
    for k in 0..300 {
        let origin = 3.0 * spot(k * 3 + 1);
        let ray = Ray::new(origin, 0.8 * spot(k * 7 % 1000) - origin);
        let mut expected: Vec<Interval> = balls.iter().flat_map(|part| intervals(part, &ray)).collect();
        expected.sort_by(|a, b| a.t_in.total_cmp(&b.t_in));
        expected.dedup_by(|next, last| {
            next.t_in <= last.t_out && {
                last.t_out = last.t_out.max(next.t_out);
                true
            }
        });
        assert_eq!(intervals(&flat, &ray), expected, "ray {k}");
        assert_eq!(intervals(&deep[0], &ray), expected, "ray {k}, as a tree");
        let mut left = Vec::new();
        freeform::difference(&intervals(&ball(DVec3::ZERO, 1.2), &ray), &expected, &mut left);
        assert_eq!(intervals(&bored, &ray), left, "ray {k}, bored");
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let part = || ball(DVec3::ZERO, 1.0);
    for operation in [Operation::Union, Operation::Intersection, Operation::Difference, Operation::Complement] {
        assert_eq!(Solid::join(operation, Psi::Maximum, vec![]), Err(FormError::Empty(operation.name())), "no parts");
    }
    let two = vec![part(), part()];
    assert_eq!(
        Solid::join(Operation::Complement, Psi::Maximum, two.clone()),
        Err(FormError::ManyComplements),
        "two parts"
    );
    for width in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Solid::union(Psi::Blend { width }, two.clone()).is_err(), "width {width}");
    }
    assert!(Solid::cuboid(DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)).is_err(), "a box without inside");
    let mut deep = part();
    for _ in 0..DEPTH_LIMIT {
        deep = deep.complement().unwrap();
    }
    assert_eq!(deep.complement(), Err(FormError::TooDeep), "too deep");
    let refused = |text: &str, line: usize, why: &str| {
        let error = text.parse::<Solid>().unwrap_err();
        assert!(error.line == line && error.what.contains(why), "{text}: {error}");
    };
    let form = "form(base -1 -1 -1 0 0 0 0 0 0 1)";
    refused("", 1, "the text ends");
    refused("cube()", 1, "'cube'");
    refused("union(\nform(base 1 2 x))", 2, "'x' is not a number");
    refused("union()", 1, "')' where a word or a number");
    refused("form(base -1, -1)", 1, "',' where a word or a number");
    refused(&format!("union(\n{form},\n{form}"), 3, "')' is missing");
    refused(&format!("{form} {form}"), 1, "text after");
    refused("form(base 0 0 0 0 0 0 0 0 0 0)", 1, "all ten");
    refused("form(base 0 0 0 0 0 0 0 0 0 nan)", 1, "not finite");
    refused(&format!("union(blend -1, {form})"), 1, "out of range");
    refused(&"complement(\n".repeat(1_000_000), DEPTH_LIMIT + 1, "deeper");
}

#[test]
fn a_start_on_the_surface_of_a_blend_is_no_hit_whatever_cell_it_is_in() {
    // The ball's half x < -u: its flat face is two roundings from the start, and the border of two cells lies between.
    let (home, u) = (DVec3::new(1000.0, 0.0, 0.0), 1000f64.next_up() - 1000.0);
    let form = |quadric: Quadric| FreeForm::with_origin(home, quadric, vec![]).unwrap().into();
    let plane = Quadric::new([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, u]).unwrap();
    let parts = vec![form(Quadric::sphere(DVec3::ZERO, 1.0).unwrap()), form(plane)];
    let half = Solid::difference(Psi::Blend { width: 0.1 }, parts).unwrap();
    let ray = Ray::new(DVec3::new(1000.0 + u, 0.3, 0.2), DVec3::NEG_X);
    let hit = half.first_hit(&ray).expect("the round side");
    assert!(!hit.entering && hit.t > 0.5, "{hit:?}");
    // And from outside both faces are met.
    let both = Ray::new(DVec3::new(1002.0, 0.3, 0.2), DVec3::NEG_X);
    let inside = intervals(&half, &both);
    assert_eq!(inside.len(), 1, "{inside:?}");
    assert!((inside[0].t_in - 2.0).abs() < 1e-9 && inside[0].t_out > 2.5, "{inside:?}");
}

#[test]
fn a_blend_is_met_by_rays_that_aim_at_its_origin() {
    // The nearest point of such a ray to the origin is rounding alone, and no measure of anything.
    let parts = vec![ball(DVec3::ZERO, 1.0), ball(DVec3::new(0.1, 0.0, 0.0), 0.3)];
    let solid = Solid::union(Psi::Blend { width: 0.1 }, parts).unwrap();
    for x in 1..12 {
        let origin = DVec3::new(5.0, f64::from(x), 3.0);
        let hit = solid.first_hit(&Ray::new(origin, -origin.normalize())).expect("it aims at the middle");
        assert!(hit.entering && (hit.t - origin.length() + 1.0).abs() < 1e-12, "{hit:?} from {origin}");
    }
}

#[test]
fn a_ray_beside_a_blend_stays_outside_whatever_rounding_is_far_off() {
    // Along two parallel planes that are blended, a little above them: far out, rounding of the ray is more than its
    // height.
    let half_space = |n: DVec3, depth: f64| -> Solid {
        FreeForm::new(Quadric::half_space(-depth * n, n).expect("a direction"), vec![]).expect("sound").into()
    };
    for (n, d) in [
        (DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, -1.0, 0.0)),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 1.0, -1.0)),
    ] {
        let n = n.normalize();
        let blend =
            Solid::union(Psi::Blend { width: 0.1 }, vec![half_space(n, 0.0), half_space(n, 1.0)]).expect("parts");
        for height in [1e-3, 1e-4, 1e-6] {
            let ray = Ray::new(height * n, d.normalize());
            assert!(blend.value(ray.origin) < 0.0, "outside");
            let inside = intervals(&blend, &ray.between(0.0, 1e3));
            assert!(inside.is_empty(), "{height} above {n}: {inside:?}");
            assert!(intervals(&blend, &ray).first().is_none_or(|i| i.t_in > 1e6), "nor for long: {height} above {n}");
        }
    }
}

#[test]
fn to_weigh_a_blend_does_not_cut_its_cells() {
    let parts = (0..8).map(|i| ball(DVec3::X * f64::from(i), 0.7)).collect();
    let molten = Solid::union(Psi::Blend { width: 0.2 }, parts).unwrap();
    let before = molten.memory_bytes();
    assert_eq!(molten.memory_bytes(), before, "weighed twice");
    assert!(molten.any_hit(&Ray::new(DVec3::Z * 5.0, -DVec3::Z)), "a ray asks for them");
    assert!(molten.memory_bytes() > before + 10_000, "then they count: {before} to {}", molten.memory_bytes());
}
