//! Caustics on surfaces that are diffuse, or there, only in places: photons beside those places count, too.

use glam::{Vec2, Vec3};
use integrator::Method;
use scene::{Material, Scene, Texture};
use tests::{Builder, Effort, film, gloss, lambert, lamp, mirror, print};

/// A lamp before a mirror, above what is to be looked at in z = 0.
fn lit(floor: Builder) -> Builder {
    floor
        .square(Vec3::new(0.0, -1.0, 0.9), Vec3::new(0.0, 1.0, -0.2), 0.4, lamp(8.0))
        .square(Vec3::new(0.0, 1.2, 0.7), Vec3::new(0.0, -1.0, -0.1), 0.7, mirror(0.9))
        .view(Vec3::new(0.2, 0.1, 2.5), Vec3::ZERO, 40.0)
}

/// A floor with stripes that are narrower than the discs that photons are counted in.
fn striped(material: Material, [dark, bright]: [Vec3; 2]) -> Builder {
    let mut floor = Builder::default().square(Vec3::ZERO, Vec3::Z, 1.5, material);
    floor.description.textures.push(Texture::from_linear(8, 1, [[dark; 4], [bright; 4]].concat()));
    let mesh = &mut floor.description.meshes[0];
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(20.0 * p.x, p.y)).collect();
    mesh.uv_indices.clone_from(&mesh.triangles);
    floor
}

/// A floor of boards, of which every second one is `other`.
fn boards(width: f32, other: &Material) -> Builder {
    #[expect(clippy::cast_possible_truncation, reason = "a few boards")]
    let half = (1.5 / width).round() as i32;
    (-half..half).fold(Builder::default(), |floor, board| {
        let [left, right] = [board, board + 1].map(|edge| width * edge as f32);
        let corners = [(left, -1.5), (right, -1.5), (right, 1.5), (left, 1.5)].map(|(x, y)| Vec3::new(x, y, 0.0));
        floor.polygon(&corners, if board % 2 == 0 { lambert(0.8) } else { other.clone() })
    })
}

/// The mean of the caustic in a picture of `side` x `side` pixels.
fn caustic(scene: &Scene, side: u32, method: Method, seed: u64) -> f64 {
    let effort = Effort { side, path_spp: 4_194_304 / (side * side), spp: 16, ..Effort::default() };
    let caustic = film(scene, method, &effort, seed).caustic;
    caustic.iter().map(|radiance| f64::from(radiance.x)).sum::<f64>() / caustic.len() as f64
}

/// Asserts that photons find as much of the caustic as the path tracer, but for `bound` of it.
fn assert_caustic(name: &str, floor: Builder, bound: f64) {
    let scene = lit(floor).build();
    let expected = caustic(&scene, 64, Method::Path, 1);
    assert_caustic_is(expected, &scene, 64, name, bound);
}

/// Asserts that photons, which all methods but the path tracer ask alike, find `expected`, but for `bound` of it.
fn assert_caustic_is(expected: f64, scene: &Scene, side: u32, name: &str, bound: f64) {
    assert!(expected > 1e-3, "{name}: there is a caustic");
    let ratio = (2..6).map(|seed| caustic(scene, side, Method::Reproject, seed)).sum::<f64>() / 4.0 / expected;
    print(&format!("{name}: ratio {ratio:.4}"));
    assert!((ratio - 1.0).abs() < bound, "{name}: ratio {ratio}");
}

#[test]
fn caustics_on_pictures_that_are_black_in_parts() {
    let material = Material { diffuse_texture: Some(0), ..lambert(0.8) };
    let plain = lit(Builder::default().square(Vec3::ZERO, Vec3::Z, 1.5, lambert(0.8))).build();
    let [known, expected, gathered, cached] = [Method::Path, Method::Reproject, Method::Gather, Method::CacheOnly]
        .map(|method| caustic(&plain, 64, method, 2));
    assert!((expected / known - 1.0).abs() < 0.02, "plain: {expected} instead of {known}");
    assert_eq!([gathered, cached], [expected; 2], "by the same photons");
    assert_caustic("stripes", striped(material, [Vec3::ZERO, Vec3::ONE]), 0.02);
}

#[test]
fn caustics_on_surfaces_with_holes() {
    let floor = |material| lit(Builder::default().square(Vec3::ZERO, Vec3::Z, 1.5, material)).build();
    // Nothing lies below, and light does not come through the floor.
    let whole = caustic(&floor(lambert(0.8)), 64, Method::Path, 1);
    for opacity in [0.7, 0.3] {
        let veil = floor(Material { opacity, ..lambert(0.8) });
        assert_caustic_is(f64::from(opacity) * whole, &veil, 64, &format!("opacity {opacity}"), 0.03);
    }
    let cut = Material { opacity_texture: Some(0), ..lambert(0.8) };
    assert_caustic("mask", striped(cut, [Vec3::ZERO, Vec3::ONE]), 0.02);
}

#[test]
fn caustics_beside_what_is_not_diffuse() {
    // Boards of a floor: every second one has nothing that a photon could count for.
    for (name, other) in [("mirror", mirror(0.5)), ("gloss", gloss(0.3, 0.5)), ("black", lambert(0.0))] {
        assert_caustic(&format!("boards, {name}"), boards(0.25, &other), 0.02);
    }
}

#[test]
fn caustics_within_pixels_that_hold_several_edges() {
    // Pixels of 0.11 m show parts of two or three boards, each with a coverage of its own.
    let scene = lit(boards(0.1, &lambert(0.0))).build();
    assert_caustic_is(caustic(&scene, 16, Method::Path, 1), &scene, 16, "narrow boards", 0.03);
}
