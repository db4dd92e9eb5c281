//! Places where light must not come, or hardly.

use glam::{DVec3, UVec2, Vec2, Vec3};
use integrator::{Film, Method};
use tests::graded::{Graded, slit};
use tests::{Builder, Effort, METHODS, Pictures, black, cuboid, lambert, measure, print};

/// Two rooms 2 x 2 x 2 without a ceiling on either side of a wall of the given thickness around x = 0, a light in the
/// one at x > 0, black night around. Light that leaves it goes up and never comes back, so the other room is dark.
fn two_rooms(thickness: f32) -> Builder {
    let grey = || lambert(0.7);
    let wall = |x: f32, normal| {
        let half = Vec3::new(0.0, 1.0, 0.0);
        let (a, b) = (Vec3::new(x, 0.0, 0.0) - half, Vec3::new(x, 0.0, 0.0) + half);
        let up = Vec3::Z * 2.0;
        if normal { [a, b, b + up, a + up] } else { [b, a, a + up, b + up] }
    };
    let mut rooms = Builder::default()
        .polygon(&wall(-2.0, true), grey())
        .polygon(&wall(2.0, false), grey())
        .mesh(cuboid(Vec3::new(-2.0, -1.1, -0.1), Vec3::new(2.0, -1.0, 2.0)), grey())
        .mesh(cuboid(Vec3::new(-2.0, 1.0, -0.1), Vec3::new(2.0, 1.1, 2.0)), grey())
        .square(Vec3::ZERO, Vec3::Z, 2.0, grey())
        .point_light(Vec3::new(0.8, 0.0, 1.0), 10.0);
    rooms = if thickness > 0.0 {
        let half = 0.5 * thickness;
        rooms.mesh(cuboid(Vec3::new(-half, -1.0, -0.1), Vec3::new(half, 1.0, 2.0)), grey())
    } else {
        rooms.polygon(&wall(0.0, true), grey())
    };
    rooms.view(Vec3::new(-0.3, -0.2, 6.0), Vec3::new(0.0, 0.0, 0.0), 26.0)
}

#[test]
fn no_leak_through_a_thin_wall() {
    // In the last two, records reach several pixels at least, however near the wall is.
    let coarse = [0.1, 1e-2, 1e-3, 1e-4, 0.0].map(|thickness| (thickness, 40, 0.25));
    let fine = [1e-3, 0.0].map(|thickness| (thickness, 160, 0.02));
    for (thickness, side, quality) in coarse.into_iter().chain(fine) {
        let scene = two_rooms(thickness).build();
        let effort = Effort { side, path_spp: 16, spp: 4, seeds: 1, quality, direct_fit: true };
        for method in METHODS {
            let pictures = Pictures::new(&scene, method, &effort);
            let room = |side: f64| {
                // Not the rims of the walls nor what lies within a pixel of them.
                let inside = move |p: &DVec3| {
                    p.x * side > 0.5 * f64::from(thickness) + 0.1 && p.x.abs() < 1.9 && p.y.abs() < 0.9 && p.z < 1.9
                };
                let films = pictures.films.iter().flat_map(Film::picture);
                let pixels = films.zip(pictures.points.iter().cycle());
                pixels.filter(move |(_, p)| p.is_some_and(|p| inside(&p))).map(|(l, _)| f64::from(l.x))
            };
            let mean = |side| room(side).sum::<f64>() / room(side).count() as f64;
            let (lit, dark, brightest) = (mean(1.0), mean(-1.0), room(-1.0).fold(0.0, f64::max));
            let what = format!(
                "wall of {thickness}, {}: dark {:.2e}, worst {:.2e} of the lit room",
                method.name(),
                dark / lit,
                brightest / lit
            );
            print(&what);
            assert!(room(-1.0).count() > 400 && lit > 0.3, "both rooms are seen, one of them lit: {lit}");
            assert_eq!(brightest, 0.0, "{what}");
        }
    }
}

#[test]
fn thin_gap_lets_in_what_it_must() {
    for height in [1.0, 0.1] {
        let Graded { scene, known } = slit(height);
        let effort = Effort { path_spp: 256, spp: 4, seeds: 48, quality: 1.0, ..Effort::default() };
        for method in METHODS {
            let (measured, what) = (measure(&scene, method, &effort, &known), format!("slit of {height}"));
            if height == 1.0 || method == Method::Path {
                measured.assert_holds(&what);
            } else {
                // 2.5e-3 of the hemisphere is less than one texel of 16 x 16: a pixel sees it or not, the mean is
                // right.
                print(&format!("{what}, {}: {:.4}", method.name(), measured.mean));
                assert!((measured.mean - 1.0).abs() < 0.1, "{what}, {}: {measured:?}", method.name());
            }
        }
    }
}

#[test]
fn light_that_changes_within_a_pixel_is_the_mean_of_it() {
    // The slit from without: the floor goes on at x < 0, where d is negative, and is seen at a tenth of the normal's
    // slant. A pixel is 0.1 long there.
    const HEIGHT: f32 = 0.02;
    let end = 1e3;
    let floor = [(-end, -end), (end, -end), (end, end), (-end, end)].map(|(x, y)| Vec3::new(x, y, 0.0));
    let roof = [(0.0, end), (end, end), (end, -end), (0.0, -end)].map(|(x, y)| Vec3::new(x, y, HEIGHT));
    let scene = Builder::default()
        .polygon(&floor, lambert(0.5))
        .polygon(&roof, black())
        .sky(1.0)
        .view(Vec3::new(-3.0, 0.0, 0.3), Vec3::ZERO, 3.0)
        .build();
    let radiance = |p: DVec3| 0.25 * (1.0 - p.x / p.x.hypot(f64::from(HEIGHT)));
    let effort = Effort { seeds: 16, quality: 1.0, ..Effort::default() };
    let shown = |film: Vec2| {
        let ray = scene.camera_ray(film, UVec2::splat(effort.side));
        let p = scene.surface(&ray, &scene.intersect(&ray).expect("the floor or the roof")).p.as_dvec3();
        if p.z < 0.5 * f64::from(HEIGHT) { radiance(p) } else { 0.0 }
    };
    let mean = |pixel: u32| {
        let corner = UVec2::new(pixel % effort.side, pixel / effort.side).as_vec2();
        let at = |i: u32| shown(corner + (UVec2::new(i % 4, i / 4).as_vec2() + 0.5) / Vec2::new(4.0, 64.0));
        (0..256).map(at).sum::<f64>() / 256.0
    };
    let known: Vec<f64> = (0..effort.side * effort.side).map(mean).collect();
    for method in [Method::Reproject, Method::CacheOnly] {
        let pictures = Pictures::new(&scene, method, &effort);
        for range in [0.01..0.1, 0.4..0.49] {
            let row = known.iter().enumerate().filter(|(_, known)| range.contains(*known));
            let films = || pictures.films.iter().map(Film::picture);
            let errors = row.flat_map(|(pixel, known)| films().map(move |film| f64::from(film[pixel].x) / known - 1.0));
            let errors: Vec<f64> = errors.collect();
            let count = errors.len() as f64;
            let mean = errors.iter().sum::<f64>() / count;
            let rms = (errors.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
            let what = format!("slit seen flatly, {}, {range:?}: off by {mean:.3}, a pixel by {rms:.3}", method.name());
            print(&what);
            assert!(count >= 256.0, "a row of pixels: {count}");
            assert!(mean.abs() < 0.1 && rms < 0.4, "{what}");
        }
    }
}

#[test]
fn window_gives_lamberts_irradiance() {
    // A closed black room with a window x = 2, |y| <= 0.5, 1 <= z <= 2 to a sky of 1: E(origin) = 0.0730414300.
    let wall = |y0: f32, y1: f32, z0: f32, z1: f32| {
        [(y1, z0), (y0, z0), (y0, z1), (y1, z1)].map(|(y, z)| Vec3::new(2.0, y, z))
    };
    let scene = Builder::default()
        .mesh(cuboid(Vec3::new(-3.0, -3.0, 3.0), Vec3::new(2.0, 3.0, 3.1)), black())
        .mesh(cuboid(Vec3::new(-3.1, -3.0, 0.0), Vec3::new(-3.0, 3.0, 3.0)), black())
        .mesh(cuboid(Vec3::new(-3.0, 3.0, 0.0), Vec3::new(2.0, 3.1, 3.0)), black())
        .mesh(cuboid(Vec3::new(-3.0, -3.1, 0.0), Vec3::new(2.0, -3.0, 3.0)), black())
        .polygon(&wall(-3.0, 3.0, 0.0, 1.0), black())
        .polygon(&wall(-3.0, 3.0, 2.0, 3.0), black())
        .polygon(&wall(-3.0, -0.5, 1.0, 2.0), black())
        .polygon(&wall(0.5, 3.0, 1.0, 2.0), black())
        .square(Vec3::ZERO, Vec3::Z, 0.05, lambert(1.0))
        .polygon(&[(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)].map(|(x, y)| Vec3::new(x, y, -0.01)), black())
        .sky(1.0)
        .view(Vec3::new(-0.5, 0.0, 0.5), Vec3::ZERO, 4.0)
        .build();
    let window = [(-0.5, 1.0), (0.5, 1.0), (0.5, 2.0), (-0.5, 2.0)].map(|(y, z)| DVec3::new(2.0, y, z));
    let known = |p: DVec3| tests::polygon_irradiance(&window, p, DVec3::Z) / std::f64::consts::PI;
    assert!((known(DVec3::ZERO) * std::f64::consts::PI - 0.073_041_43).abs() < 1e-9, "the known value");
    for method in METHODS {
        let effort = Effort { side: 8, path_spp: 512, spp: 4, seeds: 64, quality: 1.0, direct_fit: true };
        let measured = measure(&scene, method, &effort, known);
        if method == Method::Path {
            measured.assert_unbiased("window");
        } else {
            // The window fills 24 of the 32 x 32 texels of a record, and about 18 of them its rim: these are in or out,
            // so that a record is off by sqrt(18) / 2 / 24 = 9 % and the mean of 64 seeds by 1.1 %, at worst. Three
            // times that.
            print(&format!("window, {}: {:.4}", method.name(), measured.mean));
            assert!((measured.mean - 1.0).abs() < 0.033, "window, {}: {measured:?}", method.name());
        }
    }
}

#[test]
fn light_of_one_sheet_is_not_taken_for_that_of_the_next() {
    // Two sheets with a gap that is narrower than cells of light are; the left side of the first is lit, that of the
    // second is deep in the gap.
    const GAP: f32 = 0.1;
    let sheet = |x: f32| [(-0.5, 0.0), (-0.5, 1.0), (0.5, 1.0), (0.5, 0.0)].map(|(y, z)| Vec3::new(x, y, z));
    let wall = |x: f32| [(-3.0, 0.0), (3.0, 0.0), (3.0, 3.0), (-3.0, 3.0)].map(|(y, z)| Vec3::new(x, y, z));
    let back = [(-2.0, 0.0), (2.0, 0.0), (2.0, 3.0), (-2.0, 3.0)].map(|(x, z)| Vec3::new(x, 3.0, z));
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 3.0, lambert(0.5))
        .polygon(&wall(-2.0), lambert(0.6))
        .polygon(&wall(2.0), lambert(0.6))
        .polygon(&back, lambert(0.6))
        .polygon(&sheet(0.0), lambert(0.8))
        .polygon(&sheet(GAP), lambert(0.8))
        .point_light(Vec3::new(-1.5, 0.0, 2.0), 10.0)
        .view(Vec3::new(-0.15, -3.5, 0.8), Vec3::new(0.05, 0.0, 0.6), 40.0)
        .build();
    let within = |p: &DVec3| (p.x - f64::from(GAP)).abs() < 1e-3 && p.y > -0.3 && (0.1..0.9).contains(&p.z);
    let mean = |method| {
        let effort = Effort { side: 96, path_spp: 128, spp: 16, seeds: 4, quality: 1.0, direct_fit: true };
        let pictures = Pictures::new(&scene, method, &effort);
        let films = pictures.films.iter().flat_map(Film::picture);
        let seen = films.zip(pictures.points.iter().cycle()).filter(|(_, p)| p.is_some_and(|p| within(&p)));
        let seen: Vec<f64> = seen.map(|(l, _)| f64::from(l.x)).collect();
        assert!(seen.len() >= 80, "the gap is seen: {}", seen.len());
        seen.iter().sum::<f64>() / seen.len() as f64
    };
    let reference = mean(Method::Path);
    // `gather` looks from one place of each pixel, in which light falls by a half here.
    for method in [Method::Reproject, Method::CacheOnly] {
        let ratio = mean(method) / reference;
        print(&format!("in the gap, {}: {ratio:.4}", method.name()));
        assert!((ratio - 1.0).abs() < 0.04, "{}: {ratio}", method.name());
    }
}
