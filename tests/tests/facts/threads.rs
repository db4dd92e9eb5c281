//! The same bits, however many threads there are.

use glam::{UVec2, Vec3};
use integrator::{Method, Rendering, SecondaryKind, Settings, Study, render};
use tests::{Builder, METHODS, cuboid, glass, gloss, lambert, lamp, mirror};

#[test]
fn picture_does_not_depend_on_the_threads() {
    let scene = Builder::default()
        .cube_room(&lambert(0.6))
        .square(Vec3::Z * 0.99, Vec3::NEG_Z, 0.3, lamp(8.0))
        .square(Vec3::new(-0.9, 0.0, 0.0), Vec3::X, 0.4, mirror(0.9))
        .mesh(cuboid(Vec3::new(0.2, -0.1, -1.0), Vec3::new(0.7, 0.5, -0.2)), gloss(0.3, 0.8))
        .ball(Vec3::new(-0.3, 0.2, -0.6), 0.4, glass(1.5, 0.0))
        .sky(0.2)
        .view(Vec3::new(0.5, -0.9, 0.1), Vec3::new(0.0, 1.0, -0.3), 70.0)
        .build();
    let cells = METHODS.map(|method| (method, SecondaryKind::Cells));
    for (method, secondary) in cells.into_iter().chain([(Method::Reproject, SecondaryKind::Photons)]) {
        let settings = Settings {
            method,
            study: Study { secondary: Some(secondary), ..Study::default() },
            size: UVec2::new(37, 23),
            spp: Some(4),
            quality: 0.02,
            rungs: true,
            records: true,
            seed: 5,
        };
        let with_threads = |threads| -> Rendering {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut rendering = pool.install(|| render(&scene, &settings, &|_| ())).unwrap();
            rendering.statistics.render_seconds = 0.0;
            rendering.statistics.phases.clear();
            rendering
        };
        let one = with_threads(1);
        // Counts and bits; a comparison of floats would take 0 for -0.
        let bits = |rendering: &Rendering| -> Vec<u32> {
            rendering.film.picture().iter().flat_map(|l| l.to_array()).map(f32::to_bits).collect()
        };
        for threads in [2, 3] {
            let other = with_threads(threads);
            assert_eq!(bits(&one), bits(&other), "{}, {threads} threads", method.name());
            assert_eq!(one, other, "{}, {threads} threads: terms and counts", method.name());
        }
    }
}
