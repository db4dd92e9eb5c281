//! What holds for any form: normals, boxes, restarts and files.

use freeform::{Bounds, DEPTH_LIMIT, FormError, FreeForm, Interval, Perturbation, Psi, Quadric, Ray, Solid};
use glam::DVec3;
use proptest::prelude::*;

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    [-size..size, -size..size, -size..size].prop_map(DVec3::from_array)
}

fn any_quadric() -> impl Strategy<Value = Quadric> {
    prop::array::uniform10(-1.0..1.0).prop_map(|c| Quadric::new(c).expect("finite, not zero"))
}

fn any_form() -> impl Strategy<Value = FreeForm> {
    let perturbation = (any_quadric(), -1.0..1.0).prop_map(|(quadric, factor)| Perturbation { quadric, factor });
    (any_quadric(), prop::collection::vec(perturbation, 0..5))
        .prop_map(|(base, p)| FreeForm::new(base, p).expect("sound"))
}

/// A bounded body: an ellipsoid with ellipsoids in and out of it.
fn body() -> impl Strategy<Value = FreeForm> {
    let ellipsoid = |at: f64| {
        (vector(at), vector(0.4))
            .prop_map(|(c, r)| Quadric::ellipsoid(c, r + DVec3::splat(0.6)).expect("positive radii"))
    };
    let perturbation = (ellipsoid(1.0), -1.0..1.0).prop_map(|(quadric, factor)| Perturbation { quadric, factor });
    (ellipsoid(0.2), prop::collection::vec(perturbation, 0..6))
        .prop_map(|(base, p)| FreeForm::new(base, p).expect("sound"))
}

proptest! {
    #[test]
    fn gradient_is_the_slope_of_the_value(form in any_form(), p in vector(2.0)) {
        let h = 1e-5;
        let solid = Solid::from(form.clone());
        let g = solid.gradient(p);
        for axis in DVec3::AXES {
            let slope = (solid.value(p + h * axis) - solid.value(p - h * axis)) / (2.0 * h);
            prop_assert!((slope - g.dot(axis)).abs() < 1e-6 * (1.0 + g.length()), "{} against {}", slope, g);
            let turn = (solid.gradient(p + h * axis) - solid.gradient(p - h * axis)) / (2.0 * h);
            let expected = form.hessian(p) * axis;
            prop_assert!((turn - expected).length() < 1e-3 * (1.0 + expected.length()), "{} against {}", turn, expected);
        }
    }

    #[test]
    fn bounds_hold(form in body(), points in prop::collection::vec(vector(1.5), 8000)) {
        let solid = Solid::from(form);
        let Bounds::Finite { min, max } = solid.bounds() else { return Err(TestCaseError::fail("ellipsoids are bounded")) };
        for p in points.into_iter().filter(|p| solid.value(*p) >= 0.0) {
            prop_assert!(p.cmpge(min).all() && p.cmple(max).all(), "{} is outside {} {}", p, min, max);
        }
    }

    #[test]
    fn rays_restart_from_hits(form in body(), origin in vector(4.0), aim in vector(0.8)) {
        let solid = Solid::from(form);
        let d = aim - origin;
        let ray = Ray::new(origin, d);
        if let Some(hit) = solid.first_hit(&ray) {
            let p = ray.at(hit.t);
            let slope = solid.gradient(p).length();
            prop_assert!(solid.value(p).abs() < 1e-12 * (1.0 + slope), "value {:e}", solid.value(p));
            // Where curvature is mild, the ray along the normal leaves and the one against it stays in for a while.
            if slope > 0.1 {
                let n = solid.normal(p, d);
                prop_assert!((n.length() - 1.0).abs() < 1e-12, "unit");
                let out = solid.first_hit(&Ray::new(p, n));
                prop_assert!(out.is_none_or(|c| c.entering && c.t > 1e-9), "outwards {:?}", out);
                let back = solid.first_hit(&Ray::new(p, -n));
                prop_assert!(back.is_some_and(|c| !c.entering && c.t > 1e-9), "inwards {:?}", back);
            }
        }
    }

    #[test]
    fn union_is_or(forms in prop::collection::vec(body(), 1..4), p in vector(2.0)) {
        let parts: Vec<Solid> = forms.into_iter().map(Solid::from).collect();
        let any = parts.iter().any(|part| part.value(p) >= 0.0);
        for psi in [Psi::Maximum, Psi::RFunction] {
            let union = Solid::union(psi, parts.clone()).expect("parts");
            prop_assert_eq!(union.value(p) >= 0.0, any, "{:?} at {}", psi, p);
            let h = 1e-6;
            let g = union.gradient(p);
            if psi == Psi::RFunction && union.value(p).abs() > 1e-3 {
                for axis in DVec3::AXES {
                    let slope = (union.value(p + h * axis) - union.value(p - h * axis)) / (2.0 * h);
                    prop_assert!((slope - g.dot(axis)).abs() < 1e-5 * (1.0 + g.length()), "{} against {}", slope, g);
                }
            }
        }
    }

    #[test]
    fn union_walks_as_its_parts_do(forms in prop::collection::vec(body(), 1..5), origin in vector(3.0), aim in vector(1.0)) {
        let parts: Vec<Solid> = forms.into_iter().map(Solid::from).collect();
        let ray = Ray::new(origin, aim - origin);
        let stretches = |solid: &Solid| {
            let mut inside = Vec::new();
            solid.intervals(&ray, &mut inside);
            inside
        };
        // Where any part begins or ends, and no other hides it.
        let of_parts: Vec<Vec<Interval>> = parts.iter().map(stretches).collect();
        let is_bare = |part: usize, t: f64| {
            let others = of_parts.iter().enumerate().filter(|(other, _)| *other != part);
            !others.flat_map(|(_, inside)| inside).any(|i| i.t_in < t && t < i.t_out)
        };
        let ends = of_parts.iter().enumerate().flat_map(|(part, inside)| {
            inside.iter().flat_map(|i| [i.t_in, i.t_out]).filter(move |t| *t > 0.0 && t.is_finite()).map(move |t| (part, t))
        });
        let first = ends.filter(|&(part, t)| is_bare(part, t)).map(|(_, t)| t).min_by(f64::total_cmp);
        let union = Solid::union(Psi::Maximum, parts.clone()).expect("parts");
        prop_assert_eq!(union.first_hit(&ray).map(|c| c.t), first, "the first bare end of {:?}", of_parts);
        prop_assert_eq!(union.any_hit(&ray), first.is_some(), "any hit");
        for i in stretches(&union) {
            let middle = ray.at(0.5 * (i.t_in + i.t_out));
            prop_assert!(parts.iter().any(|part| part.value(middle) >= 0.0) || i.t_out - i.t_in < 1e-6, "{:?}", i);
        }
    }

    #[test]
    fn texture_coordinates_are_in_the_picture(form in body(), p in vector(3.0)) {
        let uv = Solid::from(form).texture_coordinates(p);
        prop_assert!((0.0..1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y), "{}", uv);
    }

    #[test]
    fn nothing_is_nan_whatever_comes(form in any_form(), o in prop::array::uniform3(any::<f64>()), d in prop::array::uniform3(any::<f64>())) {
        let solid = Solid::from(form);
        let (o, d) = (DVec3::from_array(o), DVec3::from_array(d));
        prop_assert!(!solid.normal(o, d).is_nan(), "a normal");
        if let Some(hit) = solid.first_hit(&Ray::line(o, d)) {
            prop_assert!(!hit.t.is_nan(), "a hit");
        }
    }
}

#[test]
fn no_ray_that_restarts_on_a_surface_gets_to_the_wrong_side() {
    // A low-discrepancy sequence in five numbers (Roberts 2018) in place of random ones.
    const ROOT: f64 = 1.167_303_978_261_418_7;
    let number = |k: u32, index: i32| (f64::from(k) * ROOT.powi(-index)).fract();
    let direction = |u: f64, v: f64| {
        let (z, angle) = (1.0 - 2.0 * u, std::f64::consts::TAU * v);
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    };
    let (mut restarts, mut skipped) = (0, 0);
    for body in 0..600 {
        let point = |k: u32| DVec3::new(number(k, 1), number(k, 2), number(k, 3)) * 2.0 - 1.0;
        let ellipsoid = |k: u32, at: f64| {
            Quadric::ellipsoid(at * point(k), DVec3::splat(0.6) + 0.4 * point(k + 7919)).expect("positive radii")
        };
        let bump =
            |k: u32| Perturbation { quadric: ellipsoid(13 * body + k, 1.0), factor: 2.0 * number(k + body, 4) - 1.0 };
        let form = FreeForm::new(ellipsoid(100_003 + body, 0.2), (1..1 + body % 6).map(bump).collect()).expect("sound");
        let solid = Solid::from(form);
        for k in 0..2500 {
            let origin = 4.0 * direction(number(k, 1), number(k, 2));
            let ray = Ray::new(origin, 0.8 * direction(number(k, 3), number(k, 4)) - origin);
            let Some(hit) = solid.first_hit(&ray) else { continue };
            // The ray's own rounding is larger near the origin than that of a point there.
            let p = ray.at(hit.t);
            let g = solid.gradient(p);
            let p = p - solid.value(p) / g.length_squared() * g;
            let (n, wi) = (solid.normal(p, ray.direction), direction(number(k, 4), number(k, 5)));
            // Where the surface is an edge, or along it, sides are not told by a normal.
            if solid.gradient(p).length() < 0.1 || n.dot(wi).abs() < 0.05 {
                skipped += 1;
                continue;
            }
            let outwards = if n.dot(wi) > 0.0 { wi } else { -wi };
            let next = solid.first_hit(&Ray::new(p, outwards));
            assert!(next.is_none_or(|c| c.entering), "body {body}, ray {k}: outside at {p}, then {next:?}");
            let next = solid.first_hit(&Ray::new(p, -outwards));
            assert!(next.is_some_and(|c| !c.entering), "body {body}, ray {k}: inside at {p}, then {next:?}");
            restarts += 2;
        }
    }
    assert!(restarts > 1_000_000 && skipped * 10 < restarts, "{restarts} restarts, {skipped} skipped");
}

#[test]
fn a_hit_from_a_few_sizes_away_is_a_start_on_the_surface() {
    // The hit is a tenth from the form's origin, its rounding that of a ray from 4.6 away: the restart saw the surface
    // again at t = 4.4e-16.
    let [xx, yy, zz] = [-21.599598846975926, -1.292914684928162, -2.5908580944775124];
    let [x, y, one] = [4.9161163737048685, -0.23564088569316774, 0.7095335503359023];
    let base = Quadric::new([xx, yy, zz, 0.0, 0.0, 0.0, x, y, 0.0, one]).unwrap();
    let solid = Solid::from(FreeForm::new(base, vec![]).unwrap());
    let origin = DVec3::new(-2.940248951731499, -1.8458084365067702, 2.99511861534917);
    let aim = DVec3::new(-0.034715929222774035, 0.017868139126088808, -0.058688881402760684);
    let ray = Ray::new(origin, aim - origin);
    let p = ray.at(solid.first_hit(&ray).expect("aimed at the form").t);
    let n = solid.normal(p, ray.direction);
    assert_eq!(solid.first_hit(&Ray::new(p, n)), None, "outwards there is nothing");
    let back = solid.first_hit(&Ray::new(p, -n));
    assert!(back.is_some_and(|c| !c.entering && c.t > 0.01), "inwards {back:?}");
    // Of a form of any size that has one, a start beside the surface is none on it.
    for r in [1e-150, 1.0, 1e150] {
        let ball = Solid::from(FreeForm::new(Quadric::sphere(DVec3::ZERO, r).unwrap(), vec![]).unwrap());
        let out = ball.first_hit(&Ray::new(DVec3::X * 0.1 * r, DVec3::X)).unwrap();
        assert!(!out.entering && (out.t / r - 0.9).abs() < 1e-9, "of radius {r}: {out:?}");
    }
}

#[test]
fn restarts_hold_on_cylinders_too() {
    // Endless along z, half a unit thick, its side near the origin, met by rays from 2 away.
    let cylinder = Quadric::new([-4.0, -4.0, 0.0, 0.0, 0.0, 0.0, 3.9, 0.0, 0.0, 0.05]).unwrap();
    let solid = Solid::from(FreeForm::new(cylinder, vec![]).unwrap());
    let mut hits = 0;
    for k in 0..20_000 {
        let number = |index: i32| 2.0 * (f64::from(k) * 1.220_744_084_605_759_5_f64.powi(-index)).fract() - 1.0;
        let aim = DVec3::new(-0.0125 + 1e-3 * number(1), 0.05 * number(2), 0.05 * number(3));
        let origin = DVec3::new(-1.9, number(2), number(4));
        let ray = Ray::new(origin, aim - origin);
        let Some(hit) = solid.first_hit(&ray) else { continue };
        let p = ray.at(hit.t);
        let n = solid.normal(p, ray.direction);
        assert!(solid.first_hit(&Ray::new(p, n)).is_none_or(|c| c.t > 1e-9), "outwards at {p}");
        assert!(solid.first_hit(&Ray::new(p, -n)).is_some_and(|c| !c.entering && c.t > 1e-9), "inwards at {p}");
        hits += 1;
    }
    assert!(hits > 19_000, "{hits} hits");
}

#[test]
fn limits_are_refused() {
    assert_eq!(Solid::union(Psi::Maximum, vec![]), Err(FormError::Empty("union")), "a union of nothing");
    let mut nested = Solid::from(FreeForm::new(Quadric::sphere(DVec3::ZERO, 1.0).unwrap(), vec![]).unwrap());
    for _ in 0..DEPTH_LIMIT {
        nested = Solid::union(Psi::RFunction, vec![nested]).unwrap();
    }
    assert_eq!(
        nested.first_hit(&Ray::new(DVec3::X * -3.0, DVec3::X)).map(|c| c.t),
        Some(2.0),
        "the limit itself works"
    );
    assert_eq!(Solid::union(Psi::Maximum, vec![nested]), Err(FormError::TooDeep), "one more is refused");
    let ball = Quadric::sphere(DVec3::ZERO, 1.0).unwrap();
    let bad = Perturbation { quadric: ball, factor: f64::NAN };
    assert_eq!(FreeForm::new(ball, vec![bad]), Err(FormError::FactorNotFinite { index: 0 }), "NaN as a factor");
    let mut numbers = ball.coefficients;
    numbers[3] = f64::INFINITY;
    assert_eq!(Quadric::new(numbers), Err(FormError::CoefficientNotFinite { index: 3 }), "an infinite coefficient");
}

#[test]
fn many_perturbations_use_the_heap_and_agree() {
    let ball = Quadric::sphere(DVec3::ZERO, 1.0).unwrap();
    let bump = |k: u32| {
        let angle = f64::from(k) * 0.7;
        let quadric = Quadric::sphere(DVec3::new(angle.cos(), angle.sin(), 0.0), 0.4).unwrap();
        Perturbation { quadric, factor: if k.is_multiple_of(2) { 0.5 } else { -0.4 } }
    };
    let few = Solid::from(FreeForm::new(ball, (0..20).map(bump).collect()).unwrap());
    // The same form: what is far away does nothing.
    let far = Perturbation { quadric: Quadric::sphere(DVec3::splat(100.0), 1.0).unwrap(), factor: -1.0 };
    let many =
        Solid::from(FreeForm::new(ball, (0..20).map(bump).chain(std::iter::repeat_n(far, 40)).collect()).unwrap());
    for k in 0..500 {
        let angle = f64::from(k) * 0.1;
        let origin = DVec3::new(3.0 * angle.sin(), 3.0 * angle.cos(), 0.3);
        let ray = Ray::new(origin, DVec3::new(0.2, 0.1, 0.0) - origin);
        assert_eq!(few.first_hit(&ray), many.first_hit(&ray), "ray {k}");
    }
}

#[test]
fn files_are_read_back_and_checked() {
    let form =
        r#"{"base":[-1,-1,-1,0,0,0,0,0,0,1],"perturbations":[{"quadric":[-1,-1,-1,0,0,0,0,2,0,-0.64],"factor":0.8}]}"#;
    let union = format!(r#"{{"union":{{"psi":"r_function","parts":[{{"form":{form}}},{{"form":{form}}}]}}}}"#);
    let read: Solid = serde_json::from_str(&union).unwrap();
    assert_eq!(read.form_count(), 2, "two parts");
    let again: Solid = serde_json::from_str(&serde_json::to_string(&read).unwrap()).unwrap();
    assert_eq!(read, again, "written and read");
    let from_toml: Solid = toml::from_str(&toml::to_string(&read).unwrap()).unwrap();
    assert_eq!(read, from_toml, "through TOML too");
    let refused = |text: &str, why: &str| {
        let error = serde_json::from_str::<Solid>(text).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    };
    refused(r#"{"form":{"base":[0,0,0,0,0,0,0,0,0,0]}}"#, "all ten");
    refused(r#"{"form":{"base":[1,0,0,0,0,0,0,0,0]}}"#, "length 9");
    refused(r#"{"union":{"parts":[]}}"#, "at least one");
    refused(r#"{"form":{"base":[1,0,0,0,0,0,0,0,0,0],"size":1}}"#, "size");
    let deep = format!(r#"{}{{"form":{form}}}{}"#, r#"{"union":{"parts":["#.repeat(40), "]}}".repeat(40));
    refused(&deep, "deeper");
}
