use fearless_simd::{Level, Simd};
use glam::{Vec3, Vec3A};

use super::build::MAX_DEPTH;
use super::{Bvh, LANES, Node, Primitive};
use crate::{Hit, Ray};

/// A stream of numbers in [0, 1) (xorshift).
pub(crate) struct Random(pub(crate) u32);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 / 16_777_216.0
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounds down to an index")]
    fn index(&mut self, count: usize) -> usize {
        ((self.next() * count as f32) as usize).min(count - 1)
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn direction(&mut self) -> Vec3A {
        loop {
            let v = Vec3A::from(self.vector()) * 2.0 - 1.0;
            if v.length_squared() > 1e-4 && v.length_squared() <= 1.0 {
                return v.normalize();
            }
        }
    }
}

fn triangle(a: Vec3, b: Vec3, c: Vec3) -> Primitive {
    Primitive::Triangle { corners: [a, b, c], cut_out: false }
}

fn closest(bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    bvh.closest(ray, |_, _| None, |_| true)
}

/// The naive version: Cramer's rule in f64 over all triangles.
fn brute_force(primitives: &[Primitive], ray: &Ray) -> Option<(f64, usize)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut nearest: Option<(f64, usize)> = None;
    for (i, primitive) in primitives.iter().enumerate() {
        let Primitive::Triangle { corners, .. } = primitive else { continue };
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let (ab, ac, ao) = (b - a, c - a, o - a);
        let det = ab.dot(d.cross(ac));
        let v = ao.dot(d.cross(ac)) / det;
        let w = d.dot(ao.cross(ab)) / det;
        let t = ac.dot(ao.cross(ab)) / det;
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 && t > 0.0 && nearest.is_none_or(|(n, _)| t < n) {
            nearest = Some((t, i));
        }
    }
    nearest
}

/// Shapes whose boxes tie or nest, `n` triangles each.
fn shapes(n: u32) -> Vec<(&'static str, Vec<Primitive>)> {
    let at = |i: u32, f: &dyn Fn(f32) -> Vec3| {
        let p = f(i as f32);
        triangle(p, p + Vec3::X, p + Vec3::Y + Vec3::Z)
    };
    let of = |f: &dyn Fn(f32) -> Vec3| (0..n).map(|i| at(i, f)).collect::<Vec<_>>();
    let mut random = Random(1);
    let mut huge = vec![triangle(Vec3::splat(-1e5), Vec3::X * 1e5, Vec3::Y * 1e5)];
    huge.extend((0..n).map(|_| {
        let p = random.vector() * 100.0;
        triangle(p, p + random.vector() * 0.1, p + random.vector() * 0.1)
    }));
    let strip = |i: u32| {
        let corner = |j: u32| Vec3::new((j / 2) as f32, (j % 2) as f32, 0.0);
        triangle(corner(i), corner(i + 1), corner(i + 2))
    };
    vec![
        ("row", of(&|i| Vec3::X * (2.0 * i))),
        ("stairs", of(&|i| Vec3::new(i, i, i))),
        ("coincident", of(&|_| Vec3::ZERO)),
        ("ring", of(&|i| Vec3::new((i * 0.01).cos(), (i * 0.01).sin(), 0.0) * 100.0)),
        ("strip", (0..n).map(strip).collect()),
        ("nested", (0..n).map(|i| triangle(Vec3::ZERO, Vec3::X * (i + 1) as f32, Vec3::Y * (i + 1) as f32)).collect()),
        (
            "sliver",
            (0..n).map(|i| triangle(Vec3::Z * i as f32, Vec3::X * 1e4, Vec3::new(1e4, 1e-3, i as f32))).collect(),
        ),
        ("huge and tiny", huge),
    ]
}

/// The number of levels of wide nodes.
fn depth(bvh: &Bvh) -> usize {
    let mut todo = vec![(0, 1)];
    let mut depth = 0;
    while let Some((node, level)) = todo.pop() {
        depth = depth.max(level);
        let node: &Node = &bvh.nodes[node];
        let is_node = |&lane: &usize| node.leaves >> lane & 1 == 0 && node.bounds[0][0][lane].is_finite();
        todo.extend((0..LANES).filter(is_node).map(|lane| (node.children[lane] as usize, level + 1)));
    }
    depth
}

#[test]
fn trees_of_bad_shapes_stay_shallow() {
    for (name, primitives) in shapes(20_000) {
        let bvh = Bvh::new(&primitives);
        assert!(depth(&bvh) <= MAX_DEPTH, "{name}: {} levels", depth(&bvh));
    }
    let coincident = vec![triangle(Vec3::ZERO, Vec3::X, Vec3::Y); 100_000];
    assert!(depth(&Bvh::new(&coincident)) <= MAX_DEPTH, "100,000 coincident triangles");
}

#[test]
fn hits_in_bad_shapes_are_those_of_brute_force() {
    for (name, primitives) in shapes(300) {
        let bvh = Bvh::new(&primitives);
        let mut random = Random(7);
        let mut hits = 0;
        for _ in 0..2000 {
            let Primitive::Triangle { corners, .. } = primitives[random.index(300)] else { panic!("a triangle") };
            // Towards the inside of a triangle from anywhere: edges are another test's.
            let (u, v) = (0.05 + 0.4 * random.next(), 0.05 + 0.4 * random.next());
            let target = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let origin = Vec3A::from(target) + random.direction() * 50.0;
            let ray = Ray::new(origin, (Vec3A::from(target) - origin).normalize());
            let expected = brute_force(&primitives, &ray);
            let hit = closest(&bvh, &ray);
            hits += usize::from(hit.is_some());
            match (expected, hit) {
                (Some((t, _)), Some(hit)) => {
                    // Slivers are met at grazing angles, where rounding of the origin moves t most.
                    assert!((f64::from(hit.t) - t).abs() <= 1e-2 * t.max(1.0), "{name}: {} is not {t}", hit.t);
                    assert!(bvh.any(&ray, |_, _| None, |_| true), "{name}: any sees what closest sees");
                }
                // A sliver thinner than rounding may be met or not.
                (None, None) => {}
                _ => assert!(name == "sliver" || name == "huge and tiny", "{name}: {expected:?} is not {hit:?}"),
            }
        }
        assert!(hits > 500, "{name}: the rays meet something: {hits}");
    }
}

/// A closed sphere of random radius steps, as triangles of a longitude-latitude grid.
fn ball(centre: Vec3, radius: f32, n: u32) -> Vec<Primitive> {
    let corner = |i: u32, j: u32| {
        let (theta, phi) =
            (std::f32::consts::PI * i as f32 / n as f32, std::f32::consts::TAU * (j % n) as f32 / n as f32);
        let ring = if i == 0 || i == n { 0.0 } else { theta.sin() };
        centre + radius * Vec3::new(ring * phi.cos(), theta.cos(), ring * phi.sin())
    };
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            if i > 0 {
                triangles.push(triangle(a, c, d));
            }
            if i + 1 < n {
                triangles.push(triangle(a, b, c));
            }
        }
    }
    triangles
}

/// In turn: to a corner `a`, to the edge to `b`, parallel to an axis, anywhere.
fn direction(i: usize, a: Vec3A, b: Vec3A, origin: Vec3A, random: &mut Random) -> Vec3A {
    match i % 4 {
        0 => a - origin,
        1 => a.lerp(b, random.next()) - origin,
        2 => Vec3A::AXES[i / 4 % 3],
        _ => random.direction(),
    }
}

#[test]
fn no_ray_escapes_from_a_closed_mesh() {
    for (centre, radius) in
        [(Vec3::ZERO, 1.0), (Vec3::splat(1e4), 10.0), (Vec3::ZERO, 1e-6), (Vec3::ZERO, 1e6), (Vec3::X * 1e4, 1.0)]
    {
        let primitives = ball(centre, radius, 12);
        let bvh = Bvh::new(&primitives);
        let mut random = Random(3);
        for i in 0..200_000 {
            let origin = Vec3A::from(centre + (random.vector() - 0.5) * radius);
            let Primitive::Triangle { corners, .. } = primitives[random.index(primitives.len())] else {
                continue;
            };
            let (a, b) = (Vec3A::from(corners[i % 3]), Vec3A::from(corners[(i + 1) % 3]));
            let direction = direction(i, a, b, origin, &mut random);
            let ray = Ray::new(origin, direction.normalize());
            assert!(closest(&bvh, &ray).is_some(), "{ray:?} escapes from {centre}, {radius}");
            assert!(bvh.any(&ray, |_, _| None, |_| true), "{ray:?} escapes from {centre}, {radius} unseen");
        }
    }
}

/// The sets of instructions that this processor has.
fn levels() -> Vec<Level> {
    let widest = Level::new();
    let mut levels = vec![Level::baseline(), widest];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(widest.as_sse4_2().map(|simd| simd.level()));
        levels.extend(widest.as_avx2().map(|simd| simd.level()));
    }
    levels
}

#[test]
fn hits_are_the_same_bits_whatever_the_processor_has() {
    let mut primitives = ball(Vec3::ZERO, 1.0, 16);
    primitives.extend(ball(Vec3::X, 0.7, 9));
    let trees: Vec<Bvh> = levels().into_iter().map(|level| Bvh { level, ..Bvh::new(&primitives) }).collect();
    let bits = |hit: Hit| (hit.primitive, hit.t.to_bits(), hit.barycentrics.to_array().map(f32::to_bits));
    let mut random = Random(5);
    let mut hits = 0;
    for i in 0..40_000 {
        let Primitive::Triangle { corners, .. } = primitives[random.index(primitives.len())] else { continue };
        let (a, b) = (Vec3A::from(corners[i % 3]), Vec3A::from(corners[(i + 1) % 3]));
        let origin = if i % 5 == 0 { a } else { Vec3A::from(random.vector()) * 3.0 - 1.5 };
        let direction = direction(i, a, b, origin, &mut random);
        let ray = Ray { t_max: 2.0, ..Ray::new(origin, direction.normalize_or(Vec3A::X)) };
        let expected = closest(&trees[0], &ray);
        hits += usize::from(expected.is_some());
        for bvh in &trees {
            assert_eq!(closest(bvh, &ray).map(bits), expected.map(bits), "{:?}: {ray:?}", bvh.level);
            assert_eq!(bvh.any(&ray, |_, _| None, |_| true), expected.is_some(), "{:?}: {ray:?}", bvh.level);
        }
    }
    assert!(hits > 10_000, "the rays meet something: {hits}");
}

#[test]
fn bad_rays_hit_nothing() {
    let bvh = Bvh::new(&ball(Vec3::ZERO, 1.0, 8));
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for x in bad {
        let rays = [
            Ray::new(Vec3A::splat(x), Vec3A::X),
            Ray::new(Vec3A::ZERO, Vec3A::new(x, 0.0, 0.0)),
            Ray::new(Vec3A::ZERO, Vec3A::new(0.0, 1.0, x)),
        ];
        for ray in rays {
            assert!(closest(&bvh, &ray).is_none(), "{ray:?}");
        }
    }
    for direction in [Vec3A::ZERO, Vec3A::splat(1e-40), Vec3A::splat(1e30)] {
        assert!(closest(&bvh, &Ray::new(Vec3A::ZERO, direction)).is_none(), "{direction}");
    }
    let empty = Ray { t_min: 2.0, t_max: 1.0, ..Ray::new(Vec3A::ZERO, Vec3A::X) };
    assert!(closest(&bvh, &empty).is_none(), "an empty range");
    assert!(closest(&Bvh::new(&[]), &Ray::new(Vec3A::ZERO, Vec3A::X)).is_none(), "an empty scene");
}

#[test]
fn range_of_the_ray_is_open() {
    let bvh = Bvh::new(&[triangle(Vec3::new(-1.0, -1.0, 2.0), Vec3::new(3.0, -1.0, 2.0), Vec3::new(-1.0, 3.0, 2.0))]);
    let ray = Ray::new(Vec3A::ZERO, Vec3A::Z);
    let hit = closest(&bvh, &ray).expect("the triangle is ahead");
    assert_eq!((hit.t, hit.primitive), (2.0, 0), "hit at its height");
    assert!(closest(&bvh, &Ray { t_max: 2.0, ..ray }).is_none(), "not at the end");
    assert!(closest(&bvh, &Ray { t_min: 2.0, ..ray }).is_none(), "not at the start");
    assert!(closest(&bvh, &Ray { t_min: 1.999, t_max: 2.001, ..ray }).is_some(), "between");
}

#[test]
fn a_ray_does_not_meet_the_triangle_on_which_it_starts() {
    let below = |y: f32| triangle(Vec3::new(-9.0, y, -9.0), Vec3::new(0.0, y, 9.0), Vec3::new(9.0, y, -9.0));
    for cut_out in [false, true] {
        let mut primitives = vec![below(0.0), below(-1.0)];
        let Primitive::Triangle { cut_out: first, .. } = &mut primitives[0] else { panic!("a triangle") };
        *first = cut_out;
        let bvh = Bvh::new(&primitives);
        // From a little above it, as rounding puts the origin sometimes.
        let ray = Ray::new(Vec3A::Y * 1e-3, Vec3A::NEG_Y);
        let from = Ray { from: 0, ..ray };
        assert_eq!(closest(&bvh, &ray).map(|hit| hit.primitive), Some(0), "a ray from nowhere meets it");
        assert_eq!(closest(&bvh, &from).map(|hit| hit.primitive), Some(1), "and one from it what is behind");
        assert!(bvh.any(&ray, |_, _| None, |_| true) && bvh.any(&from, |_, _| None, |_| true), "both meet something");
        let short = Ray { t_max: 0.5, ..from };
        assert!(!bvh.any(&short, |_, _| None, |_| true), "but not itself");
    }
    let form = Primitive::Form(crate::Aabb::of_points(&[Vec3::splat(-1.0), Vec3::ONE]));
    let bvh = Bvh::new(&[form]);
    let inside = Ray { from: 0, ..Ray::new(Vec3A::ZERO, Vec3A::X) };
    let other_side =
        |primitive, ray: &Ray| Some(Hit { t: 1.0, primitive, barycentrics: glam::Vec2::ZERO, media: ray.media });
    assert!(bvh.closest(&inside, other_side, |_| true).is_some(), "a free form may be met again");
}
