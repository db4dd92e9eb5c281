//! Light that is reflected again and again, in the few places where its sum is known.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scene::Scene;
use tests::{Builder, Effort, METHODS, Pictures, Term, lambert, measure};

#[test]
fn wedge_has_constant_irradiance() {
    // Two half-planes of albedo rho meet at phi under a sky of 1: E = pi (1 - cos phi) / 2 / (1 - rho (1 + cos phi) / 2), at every
    // distance d from the seam. Planes that end at X err by d / (2 X): X is 1e4 d, and 100 where the same planes are seen from nearer
    // and nearer.
    let cases = [
        (90.0, 0.5, 1.0, 1e4),
        (90.0, 0.5, 1e-6, 1e-2),
        (90.0, 0.5, 1e-2, 100.0),
        (90.0, 0.5, 1e-3, 100.0),
        (30.0, 0.8, 1.0, 1e4),
        (30.0, 0.8, 1e-3, 100.0),
        (150.0, 0.8, 1.0, 1e4),
        (150.0, 0.8, 1e-3, 100.0),
    ];
    for (degrees, rho, distance, end) in cases {
        let scene = wedge(degrees, rho, end, distance);
        let (cos, rho) = (f64::from(degrees).to_radians().cos(), f64::from(rho));
        let irradiance = PI * (1.0 - cos) / 2.0 / (1.0 - rho * (1.0 + cos) / 2.0);
        // The light of a narrow wedge has been reflected some five times, so that each solution for it is one percent off.
        let seeds = if degrees == 30.0 { 8 } else { 2 };
        let effort = Effort { path_spp: 128, spp: 4, seeds, quality: 1.0, ..Effort::default() };
        for method in METHODS {
            let measured = measure(&scene, method, &effort, |_| rho * irradiance / PI);
            measured.assert_holds(&format!("{degrees} degrees, {distance} from the seam of planes of {end}"));
        }
    }
}

/// Half-planes that meet in the y axis and end at `end`, seen from inside at `distance` from the seam.
fn wedge(degrees: f32, albedo: f32, end: f32, distance: f32) -> Scene {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let edge = [Vec3::new(0.0, end, 0.0), Vec3::new(0.0, -end, 0.0)];
    let other = Vec3::new(cos, 0.0, sin) * end;
    let at = Vec3::X * distance;
    Builder::default()
        .polygon(&[edge[1], edge[1] + Vec3::X * end, edge[0] + Vec3::X * end, edge[0]], lambert(albedo))
        .polygon(&[edge[0], edge[0] + other, edge[1] + other, edge[1]], lambert(albedo))
        .sky(1.0)
        .view(at + Vec3::new(0.1, 0.1, 0.25) * distance, at, 30.0)
        .build()
}

#[test]
fn integrating_sphere_is_uniform() {
    // rho = 0.5, R = 1, I = 1 at (0, 0, 0.6): each bounce brings E = rho^k I / R^2 everywhere, all together rho / (1 - rho) = 1.
    let room = Builder::default().ball_room(lambert(0.5)).point_light(Vec3::new(0.0, 0.0, 0.6), 1.0);
    let direct = |p: DVec3| {
        let to_light = DVec3::Z * 0.6 - p;
        0.5 / PI * -to_light.dot(p) / to_light.length().powi(3)
    };
    for at in [Vec3::Z, Vec3::X, Vec3::new(0.5, 0.2, -1.0)] {
        let scene = room.clone().view(Vec3::new(0.1, -0.2, 0.0), at, 50.0).build();
        let effort = Effort { path_spp: 64, spp: 16, seeds: 2, ..Effort::default() };
        for method in METHODS {
            let what = format!("towards {at}");
            let pictures = Pictures::new(&scene, method, &effort);
            pictures.relative(Term::Indirect, |_| 0.5 / PI).assert_holds(&what);
            // The pixel is compared with its middle, which where the light is near is off by second differences.
            let measured = pictures.relative(Term::Direct, direct);
            assert!((measured.mean - 1.0).abs() < 2e-3 && measured.worst < 2e-2, "{what}, direct: {measured:?}");
        }
    }
}
