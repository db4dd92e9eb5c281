//! Free forms whose crossings are known in closed form, and the places where methods fail.

use freeform::{Bounds, Crossing, FormError, FreeForm, Interval, Perturbation, Psi, Quadric, Ray, Solid, difference};
use glam::{DAffine3, DVec3};

fn quadric(coefficients: [f64; 10]) -> Quadric {
    Quadric::new(coefficients).expect("finite, not zero")
}

fn plain(base: Quadric) -> Solid {
    form(base, &[])
}

fn form(base: Quadric, perturbations: &[(Quadric, f64)]) -> Solid {
    let perturbations = perturbations.iter().map(|&(quadric, factor)| Perturbation { quadric, factor }).collect();
    Solid::from(FreeForm::new(base, perturbations).expect("sound"))
}

/// x, y, z, 1 as quadrics.
fn linear(x: f64, y: f64, z: f64, constant: f64) -> Quadric {
    quadric([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, x, y, z, constant])
}

fn ball(radius: f64) -> Quadric {
    quadric([-1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, radius * radius])
}

fn crossings(solid: &Solid, ray: &Ray) -> Vec<f64> {
    let mut inside = Vec::new();
    solid.intervals(ray, &mut inside);
    inside.iter().flat_map(|i| [i.t_in, i.t_out]).filter(|t| *t > ray.t_min && *t < ray.t_max).collect()
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}: found {found:?}, expected {expected:?}");
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= tolerance, "{what}: found {f}, expected {e}, off by {:e}", f - e);
    }
}

/// F = k^2 Q and a dent Q^3: F' = -Q (Q - k)(Q + k), solid where 0 <= Q <= k.
fn hollow_ball() -> Solid {
    let k: f64 = 0.75;
    form(Quadric::new(ball(1.0).coefficients.map(|c| k * k * c)).expect("sound"), &[(ball(1.0), -1.0)])
}

#[test]
fn sign_is_documented() {
    let sphere = plain(ball(1.0));
    assert_eq!(sphere.value(DVec3::ZERO), 1.0, "inside is positive");
    assert_eq!(sphere.normal(DVec3::X, -DVec3::X), DVec3::X, "the normal is minus the gradient");
    let swollen = form(ball(1.0), &[(ball(1.5), 1.0)]);
    assert!(swollen.value(DVec3::X * 1.2) > 0.0, "a positive factor adds matter");
    assert_eq!(
        form(ball(1.0), &[(ball(1.5), 0.0)]).value(DVec3::X * 0.3),
        sphere.value(DVec3::X * 0.3),
        "zero changes nothing"
    );
}

#[test]
fn hollow_ball_has_four_exact_roots() {
    let solid = hollow_ball();
    for b in [0.0, 0.1, 0.3, 0.49, 0.499_999] {
        let ray = Ray::new(DVec3::new(-3.0, b, 0.0), DVec3::X);
        let (outer, inner) = ((1.0 - b * b).sqrt(), (0.25 - b * b).sqrt());
        assert_near(
            &crossings(&solid, &ray),
            &[3.0 - outer, 3.0 - inner, 3.0 + inner, 3.0 + outer],
            1e-12,
            "hollow ball",
        );
    }
    let two = crossings(&solid, &Ray::line(DVec3::new(0.0, 0.7, 0.0), DVec3::X));
    assert_near(&two, &[-(0.51_f64.sqrt()), 0.51_f64.sqrt()], 1e-12, "past the hollow");
    let touching = crossings(&solid, &Ray::line(DVec3::new(0.0, 0.5, 0.0), DVec3::X));
    assert_near(&touching, &[-(0.75_f64.sqrt()), 0.75_f64.sqrt()], 1e-12, "a touch is no crossing");
    let inside = crossings(&solid, &Ray::line(DVec3::new(0.0, 0.5 - 1e-12, 0.0), DVec3::X));
    assert_eq!(inside.len(), 4, "a chord of 2e-6 is found: {inside:?}");
    assert!((inside[2] - inside[1] - 2.0e-6).abs() < 1e-9, "gap {:e}", inside[2] - inside[1]);
    assert_eq!(
        crossings(&solid, &Ray::line(DVec3::new(0.0, 0.5 + 1e-12, 0.0), DVec3::X)).len(),
        2,
        "just past the hollow"
    );
}

#[test]
fn triple_root_half_space() {
    // F' = z^3 above z = -1, negative below: the half-space z >= 0 whose gradient vanishes on the surface.
    let base = quadric([0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, -3.0, -1.0]);
    let solid = form(base, &[(linear(0.0, 0.0, 1.0, 1.0), 1.0)]);
    for d in [DVec3::Z, DVec3::new(1.0, 0.5, 0.3), DVec3::new(-0.2, 0.1, 1.0)] {
        let origin = DVec3::new(0.3, -0.2, -2.5);
        let hit = solid.first_hit(&Ray::new(origin, d)).expect("a hit");
        assert!(hit.entering, "the ray enters");
        assert!((hit.t - 2.5 / d.z).abs() * d.z < 1e-5, "z = {}", origin.z + hit.t * d.z);
        let normal = solid.normal(origin + hit.t * d, d);
        assert!((normal + DVec3::Z).length() < 1e-3, "normal {normal}");
    }
    assert!(
        (solid.normal(DVec3::new(0.4, 0.1, 0.0), DVec3::X) + DVec3::Z).length() < 1e-6,
        "the normal where the gradient is 0"
    );
}

#[test]
fn cusp_ridge_has_no_gradient() {
    // y^3 >= x^2.
    let base = quadric([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let solid = form(base, &[(linear(0.0, 1.0, 0.0, 0.0), 1.0)]);
    for b in (0..7).map(|k| 10_f64.powi(-k)) {
        let up = crossings(&solid, &Ray::new(DVec3::new(b, -2.0, 0.1), DVec3::Y));
        assert_near(&up, &[2.0 + b.powf(2.0 / 3.0)], 1e-11, "along y");
        let across = crossings(&solid, &Ray::line(DVec3::new(0.0, b, 0.1), DVec3::X));
        assert_near(&across, &[-b.powf(1.5), b.powf(1.5)], 1e-12, "along x");
        let below = crossings(&solid, &Ray::line(DVec3::new(0.0, -b, 0.1), DVec3::X));
        assert!(below.is_empty(), "the plane x = 0 below is no solid: {below:?}");
    }
    let normal = solid.normal(DVec3::new(0.0, 0.0, 0.3), DVec3::Y);
    assert!((normal + DVec3::Y).length() < 1e-6, "on the ridge: {normal}");
}

#[test]
fn ray_inside_the_surface() {
    let solid = form(linear(1.0, 0.0, 0.0, 0.0), &[(linear(0.0, 1.0, 0.0, 0.0), 1.0)]);
    let mut inside = Vec::new();
    for (origin, d) in [(DVec3::Y, -DVec3::Y), (-DVec3::Y, -DVec3::Y), (-DVec3::Y, DVec3::Y)] {
        let ray = Ray::new(origin, d);
        solid.intervals(&ray, &mut inside);
        assert_eq!(inside, [Interval { t_in: 0.0, t_out: f64::INFINITY }], "the surface is inside");
        assert!(!solid.any_hit(&ray), "and is not crossed");
    }
}

#[test]
fn thin_constant_base() {
    let solid = form(linear(0.0, 0.0, 0.0, -1e-12), &[(ball(1.0), 1.0)]);
    let r = (1.0 - 1e-4_f64).sqrt();
    assert_near(
        &crossings(&solid, &Ray::new(DVec3::new(0.0, 0.0, -2.0), DVec3::Z)),
        &[2.0 - r, 2.0 + r],
        1e-12,
        "sphere",
    );
    assert_eq!(Quadric::new([0.0; 10]), Err(FormError::AllZero), "a base of zero is refused");
    let zero = Quadric { coefficients: [0.0; 10] };
    assert_eq!(FreeForm::new(zero, vec![]), Err(FormError::AllZero), "also behind the public field");
}

/// P(s) = (s - 1)...(s - 6) as a free form along x with s = (x - start) / e: P = Q^3 - 28/3 Q - 160/27 with Q = s
/// (s - 7) + 28/3. Coefficients are about `origin`.
fn six_roots(start: f64, e: f64, origin: f64) -> Solid {
    let (a, shift) = (e.recip().powi(2), start - origin);
    // s (s - 7) in powers of x - origin.
    let (b, c) = (-a * (2.0 * shift + 7.0 * e), a * shift * (shift + 7.0 * e));
    let q = quadric([a, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, 0.0, c + 28.0 / 3.0]);
    let k = -28.0 / 3.0;
    let base = quadric([k * a, 0.0, 0.0, 0.0, 0.0, 0.0, k * b, 0.0, 0.0, k * (c + 28.0 / 3.0) - 160.0 / 27.0]);
    // Where Q < 0 a second perturbation, of -Q, makes the cube.
    let perturbations =
        vec![Perturbation { quadric: q, factor: 1.0 }, Perturbation { quadric: q.complement(), factor: -1.0 }];
    Solid::from(FreeForm::with_origin(DVec3::X * origin, base, perturbations).expect("sound"))
}

#[test]
fn wilkinson_six() {
    let ray = Ray::line(DVec3::ZERO, DVec3::X);
    let found = crossings(&six_roots(0.0, 1.0, 0.0), &ray);
    assert_near(&found, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 1e-12, "six roots");
}

#[test]
fn clustered_six() {
    // The eigenvalues of a companion matrix are wrong by 2.3e-10, 1.1e-6 and 3.3e-3 for the first three gaps; here the
    // cubes are never expanded.
    for e in [0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6] {
        let expected: Vec<f64> = (1..=6).map(|i| 1.0 + f64::from(i) * e).collect();
        for direction in [DVec3::X, -DVec3::X, DVec3::new(0.5, 0.25, -2.0)] {
            let ray = Ray::line(DVec3::X, direction);
            let place = |solid: &Solid| {
                let mut x: Vec<f64> = crossings(solid, &ray).iter().map(|t| 1.0 + t * direction.x).collect();
                x.sort_by(f64::total_cmp);
                x
            };
            // Coefficients about 0 are rounded by eps/2 of up to 2/e^2 each, which moves Q by 4 eps/e^2 together and P
            // by 3 Q^2 + 28/3 < 40 times that; P' is 12 at least. In x that is 14 eps/e, and as much again for the
            // rounding of Q on the way.
            assert_near(&place(&six_roots(1.0, e, 0.0)), &expected, 28.0 * f64::EPSILON / e, "about 0");
            // About the cluster the gap no longer matters: the condition number of s = 4 is 3150, for what is rounded
            // in the coefficients and once more in values; and 1 + i e is rounded.
            let tolerance = 2.0 * 3150.0 * f64::EPSILON * e + 2.0 * f64::EPSILON;
            assert_near(&place(&six_roots(1.0, e, 1.0)), &expected, tolerance, "about the cluster");
        }
    }
}

/// SplitMix64: a number in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The quadric a x^2 + b x + c.
fn along_x([a, b, c]: [f64; 3]) -> Quadric {
    quadric([a, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, 0.0, c])
}

/// The parabola through three points.
fn through(x: [f64; 3], y: [f64; 3]) -> [f64; 3] {
    let first = (y[1] - y[0]) / (x[1] - x[0]);
    let a = ((y[2] - y[1]) / (x[2] - x[1]) - first) / (x[2] - x[0]);
    let b = first - a * (x[0] + x[1]);
    [a, b, y[0] - x[0] * (b + a * x[0])]
}

#[test]
fn one_piece_has_at_most_four_crossings() {
    // Random bases hardly cross a cube more than twice, so each is laid through three points of it. Rolle: between
    // roots of the function lies one of each derivative. What Q is in x, the piece on which it acts, and how many
    // crossings that can have.
    let cases = [
        ("inside c - x^2: the squares of six roots would have the mean c", [-1.0, 0.0, 1.0], -1.0, 1.0, 4),
        ("x^2 + c: the third derivative 120 x^3 + 72 c x has one root", [1.0, 0.0, 1.0], -2.0, 2.0, 4),
        ("beyond x^2 - c: the third derivative 120 x^3 - 72 c x has none", [1.0, 0.0, -1.0], 1.0, 4.0, 3),
    ];
    let mut state = 1;
    for (what, q, lo, hi, bound) in cases {
        let mut most = 0;
        for _ in 0..70_000 {
            let f: f64 = if random(&mut state) < 0.5 { -1.0 } else { 1.0 };
            let x = [0; 3].map(|_| lo + (hi - lo) * random(&mut state));
            let y = x.map(|x| -f * (x * (q[0] * x + q[1]) + q[2]).powi(3));
            let solid = form(along_x(through(x, y)), &[(along_x(q), f)]);
            let piece = Ray::line(DVec3::ZERO, DVec3::X).between(lo, if bound == 3 { f64::INFINITY } else { hi });
            let found = crossings(&solid, &piece);
            assert!(found.len() <= bound, "{what}: F through {x:?}, f = {f}: {found:?}");
            most = most.max(found.len());
        }
        assert_eq!(most, bound, "{what}: the search reaches the bound");
    }
}

#[test]
fn one_piece_of_two_perturbations_reaches_six_crossings() {
    let mut state = 2;
    let mut most = 0;
    for _ in 0..70_000 {
        // Both act on all of [-1, 1].
        let bump = |state: &mut u64| {
            let middle = 0.8 * random(state) - 0.4;
            let reach = 1.0 + middle.abs() + random(state);
            [-1.0, 2.0 * middle, reach * reach - middle * middle]
        };
        let (q, r) = (bump(&mut state), bump(&mut state));
        let at = |q: [f64; 3], x: f64| (x * (q[0] * x + q[1]) + q[2]).powi(3);
        let f = -at(q, 0.0) / at(r, 0.0) * (0.5 + random(&mut state));
        let x = [-0.8, 0.1, 0.9].map(|x| x + 0.2 * random(&mut state) - 0.1);
        let y = x.map(|x| -at(q, x) - f * at(r, x));
        let solid = form(along_x(through(x, y)), &[(along_x(q), 1.0), (along_x(r), f)]);
        let found = crossings(&solid, &Ray::line(DVec3::ZERO, DVec3::X).between(-1.0, 1.0));
        assert!(found.len() <= 6, "a sextic has six roots: {found:?}");
        most = most.max(found.len());
    }
    assert_eq!(most, 6, "the arrays of a piece must hold six");
}

#[test]
fn cone_apex() {
    let solid = plain(quadric([-1.0, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    let mut inside = Vec::new();
    let all = [Interval { t_in: f64::NEG_INFINITY, t_out: f64::INFINITY }];
    solid.intervals(&Ray::line(DVec3::ZERO, DVec3::Z), &mut inside);
    assert_eq!(inside, all, "along the axis all is inside");
    solid.intervals(&Ray::line(DVec3::ZERO, DVec3::X), &mut inside);
    assert_eq!(inside, [], "across it only the apex is");
    solid.intervals(&Ray::line(DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)), &mut inside);
    assert_eq!(inside, all, "a generator lies in the closed set");
    let d = DVec3::new(0.6, 0.0, -0.8);
    assert_eq!(solid.normal(DVec3::ZERO, d), -d, "the apex faces the ray");
    assert_eq!(solid.normal(DVec3::ZERO, DVec3::ZERO), DVec3::Z, "and has a normal whatever comes");
}

#[test]
fn vanishing_leading_coefficient() {
    let paraboloid = plain(quadric([-1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    assert_near(
        &crossings(&paraboloid, &Ray::new(DVec3::new(0.5, 0.0, -1.0), DVec3::Z)),
        &[1.25],
        1e-15,
        "along the axis",
    );
    assert_near(&crossings(&paraboloid, &Ray::new(DVec3::new(0.5, 0.0, 3.0), -DVec3::Z)), &[2.75], 1e-15, "against it");
    let skew = crossings(&paraboloid, &Ray::new(DVec3::new(0.5, 0.0, -1.0), DVec3::new(1e-9, 0.0, 1.0)));
    // t - 1 = (0.5 + 1e-9 t)^2: a t^2 - b t + c with a = 1e-18, b = 1 - 1e-9, c = 1.25.
    let b: f64 = 1.0 - 1e-9;
    let large = (b + (b * b - 5e-18).sqrt()) / 2e-18;
    assert_eq!(skew.len(), 2, "both roots: {skew:?}");
    assert!((skew[0] / (1.25e18 / large) - 1.0).abs() < 1e-12 && (skew[1] / large - 1.0).abs() < 1e-12, "{skew:?}");
    let cylinder = plain(Quadric::cylinder(DVec3::ZERO, DVec3::Z, 1.0).expect("sound"));
    assert!(!cylinder.any_hit(&Ray::line(DVec3::ZERO, DVec3::Z)), "inside for all t");
    assert!(!cylinder.any_hit(&Ray::line(DVec3::X * 2.0, DVec3::Z)), "outside for all t");
    assert_near(
        &crossings(&plain(linear(0.0, 0.0, -1.0, 2.0)), &Ray::new(DVec3::ZERO, DVec3::Z)),
        &[2.0],
        0.0,
        "a plane",
    );
}

#[test]
fn near_miss() {
    let sphere = plain(ball(1.0));
    let chord = crossings(&sphere, &Ray::line(DVec3::new(0.0, 1.0 - 1e-12, 0.0), DVec3::X));
    assert_eq!(chord.len(), 2, "a chord of 2.8e-6");
    assert!((chord[1] - 2e-12_f64.sqrt()).abs() < 1e-9, "half a chord is {:e}", chord[1]);
    assert!(!sphere.any_hit(&Ray::line(DVec3::new(0.0, 1.0 + 1e-12, 0.0), DVec3::X)), "a miss by 1e-12");
}

#[test]
fn coincident_faces_in_a_union() {
    let slab = |a: f64, b: f64| plain(quadric([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, a + b, 0.0, 0.0, -a * b]));
    let union = |psi| Solid::union(psi, vec![slab(0.0, 1.0), slab(1.0, 2.0)]).expect("two parts");
    let (maximum, r_function) = (union(Psi::Maximum), union(Psi::RFunction));
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for d in [DVec3::X, DVec3::new(1.0, 0.3, -0.7), DVec3::new(0.1, 0.7, 0.2)] {
        let ray = Ray::new(DVec3::X * -0.5, d);
        maximum.intervals(&ray, &mut a);
        r_function.intervals(&ray, &mut b);
        assert_eq!(a, b, "the set does not depend on psi");
        assert_eq!(a.len(), 1, "one stretch: {a:?}");
        assert!((a[0].t_in * d.x - 0.5).abs() < 1e-15 && (a[0].t_out * d.x - 2.5).abs() < 1e-14, "{a:?}");
        let start_inside = ray.between(1.0 / d.x, f64::INFINITY);
        let exit = maximum.first_hit(&start_inside);
        assert_eq!(exit, Some(Crossing { t: a[0].t_out, entering: false, part: 1 }), "the exit is the far face");
    }
    difference(&a, &b, &mut Vec::new());
    let mut left = vec![Interval { t_in: 0.0, t_out: 1.0 }];
    difference(&a, &b, &mut left);
    assert_eq!(left, [], "the difference of equal solids is empty");
}

#[test]
fn answers_scale() {
    let bumps =
        [(Quadric::sphere(DVec3::X, 0.6).expect("sound"), 0.8), (Quadric::sphere(DVec3::Y, 0.5).expect("sound"), -0.9)];
    let base = ball(1.0);
    let rays: Vec<Ray> = (0..200)
        .map(|k| {
            let angle = f64::from(k) * 0.7;
            let origin = DVec3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 0.4 * angle.cos());
            Ray::new(origin, DVec3::new(0.3, 0.2, 0.1) * (angle * 3.0).sin() - origin)
        })
        .collect();
    let scaled = |q: Quadric, s: f64| quadric(q.coefficients.map(|c| s * c));
    let expected: Vec<_> = rays.iter().map(|ray| crossings(&form(base, &bumps), ray)).collect();
    assert!(expected.iter().filter(|c| !c.is_empty()).count() > 150, "most rays hit");
    let c = 2_f64.powi(-9);
    let times_c = form(scaled(base, c), &bumps.map(|(q, f)| (q, f * c)));
    let s = 3.7;
    let q_scaled = form(base, &bumps.map(|(q, f)| (scaled(q, s), f / (s * s * s))));
    for (ray, expected) in rays.iter().zip(&expected) {
        assert_eq!(&crossings(&times_c, ray), expected, "a common factor of 2^k changes no bit");
        assert_near(&crossings(&q_scaled, ray), expected, 1e-12, "Q times s, f times s^-3");
        for k in -6..=6 {
            let size = 10_f64.powi(k);
            let solid =
                form(base, &bumps).transformed(&DAffine3::from_scale(DVec3::splat(size))).expect("not singular");
            let ray = Ray::new(ray.origin * size, ray.direction);
            let times: Vec<f64> = expected.iter().map(|t| t * size).collect();
            assert_near(&crossings(&solid, &ray), &times, 1e-11 * size, "space times a power of ten");
        }
    }
}

#[test]
fn answers_shift() {
    let bumps = [(Quadric::sphere(DVec3::X, 0.6).expect("sound"), 0.8)];
    let solid = form(ball(1.0), &bumps);
    // Origins on a grid of 2^-10, so that moving the ray rounds nothing.
    for (k, offset) in [(1, 1e4), (2, 1e6), (3, 1e4)] {
        let offset = DVec3::new(offset, -2.0 * offset, 0.5 * offset);
        let moved = solid.transformed(&DAffine3::from_translation(offset)).expect("not singular");
        for j in 0..100 {
            let origin = (DVec3::new(-3.0, 0.01 * f64::from(j) - 0.5, 0.1 * f64::from(k)) * 1024.0).round() / 1024.0;
            let ray = Ray::new(origin, DVec3::X);
            let there = Ray::new(origin + offset, DVec3::X);
            assert_near(&crossings(&moved, &there), &crossings(&solid, &ray), 1e-11, "moved with its origin");
        }
    }
}

#[test]
fn start_on_or_inside() {
    let sphere = plain(ball(1.0));
    let mut inside = Vec::new();
    let start = Ray::new(DVec3::X, -DVec3::X);
    sphere.intervals(&start, &mut inside);
    assert_eq!(inside, [Interval { t_in: 0.0, t_out: 2.0 }], "the start belongs to the stretch");
    assert_eq!(sphere.first_hit(&start), Some(Crossing { t: 2.0, entering: false, part: 0 }), "only the exit is a hit");
    assert_eq!(sphere.first_hit(&Ray::new(DVec3::X, DVec3::X)), None, "leaving meets nothing");
    assert_eq!(
        sphere.first_hit(&Ray::new(DVec3::ZERO, DVec3::Y)),
        Some(Crossing { t: 1.0, entering: false, part: 0 }),
        "from inside"
    );
    sphere.intervals(&Ray::new(DVec3::ZERO, DVec3::Y).between(0.25, 0.5), &mut inside);
    assert_eq!(inside, [Interval { t_in: 0.25, t_out: 0.5 }], "a ray within");
}

#[test]
fn bounds_are_tight_and_hold() {
    let sphere = plain(Quadric::ellipsoid(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 1.0, 2.0)).expect("sound"));
    let Bounds::Finite { min, max } = sphere.bounds() else { panic!("finite") };
    assert!((min - DVec3::new(0.5, 1.0, 1.0)).abs().max_element() < 1e-8, "{min}");
    assert!((max - DVec3::new(1.5, 3.0, 5.0)).abs().max_element() < 1e-8, "{max}");
    let cylinder = plain(Quadric::cylinder(DVec3::ZERO, DVec3::Z, 1.0).expect("sound"));
    assert_eq!(cylinder.bounds(), Bounds::Unbounded, "a cylinder says so");
    let room = plain(ball(1.0).complement());
    assert_eq!(room.bounds(), Bounds::Unbounded, "so does a room");
}
