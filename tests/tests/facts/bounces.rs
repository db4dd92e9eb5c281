//! Light that is reflected again and again, in the few places where its sum is known.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use tests::graded::{Graded, wedge};
use tests::{Builder, Effort, METHODS, Pictures, Term, lambert, measure};

#[test]
fn wedge_has_constant_irradiance() {
    // Planes that end at X err by d / (2 X): X is 1e4 d, and 100 where the same planes are seen from nearer and nearer.
    let cases = [
        (90.0, 0.5, 1.0, 1e4),
        (90.0, 0.5, 1e-6, 1e-2),
        (90.0, 0.5, 1e-2, 100.0),
        (90.0, 0.5, 1e-3, 100.0),
        (30.0, 0.8, 1e-3, 100.0),
        (150.0, 0.8, 1e-3, 100.0),
    ];
    for (degrees, rho, distance, end) in cases {
        let Graded { scene, known } = wedge(degrees, rho, end, distance, 60.0);
        // The light of a narrow wedge has been reflected some five times, so that each solution for it is one percent
        // off.
        let seeds = if degrees == 30.0 { 8 } else { 2 };
        let effort = Effort { path_spp: 128, spp: 4, seeds, quality: 1.0, ..Effort::default() };
        for method in METHODS {
            let measured = measure(&scene, method, &effort, &known);
            measured.assert_holds(&format!("{degrees} degrees, {distance} from the seam of planes of {end}"));
        }
    }
}

#[test]
fn integrating_sphere_is_uniform() {
    // rho = 0.5, R = 1, I = 1 at (0, 0, 0.6): each bounce brings E = rho^k I / R^2 everywhere, all together rho / (1 -
    // rho) = 1.
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
