//! Descriptions that are wrong are refused by name.

use glam::Vec3;
use scene::{BuildError, Camera, Description, Material, Mesh, Noise, Pattern, Scene, SpecularKind, Texture};

#[test]
fn what_is_wrong_is_refused_by_name() {
    let good = Mesh {
        name: "quad".into(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        ..Mesh::default()
    };
    let refused = |mesh: Mesh, material: Material| {
        Scene::new(Description { meshes: vec![mesh], materials: vec![material], ..Description::default() })
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    let mut mesh = good.clone();
    mesh.positions[2].y = f32::NAN;
    assert_eq!(refused(mesh, Material::default()), "mesh \"quad\", position 2: is not finite or beyond 1e12", "a NaN");
    let mut mesh = good.clone();
    mesh.triangles[1][0] = 4;
    assert_eq!(refused(mesh, Material::default()), "mesh \"quad\", triangle 1: position 4 of 4", "an index");
    let mut mesh = good.clone();
    mesh.materials[1] = 7;
    assert_eq!(refused(mesh, Material::default()), "mesh \"quad\", triangle 1: material 7 of 1", "a material");
    let named = |change: &dyn Fn(&mut Material)| {
        let mut material = Material { name: "m".into(), ..Material::default() };
        change(&mut material);
        refused(good.clone(), material)
    };
    assert!(named(&|m| m.diffuse.x = 1.5).starts_with("material \"m\" (0): the diffuse"), "albedo above 1");
    assert!(named(&|m| m.emission.y = f32::INFINITY).contains("emission"), "an infinite emission");
    let bright = named(&|m| m.emission = Vec3::splat(3e38));
    assert_eq!(bright, "lights: their flux is beyond single precision, so bright or large are they", "too much light");
    assert!(named(&|m| m.opacity = f32::NAN).contains("opacity"), "opacity");
    assert!(named(&|m| m.diffuse_texture = Some(0)).contains("a texture does not exist"), "a texture");
    assert!(named(&|m| m.emission_texture = Some(0)).contains("a texture does not exist"), "a texture of emission");
    let noise = Noise {
        pattern: Pattern::Wood,
        size: Vec3::ONE,
        octaves: 1,
        distortion: 0.0,
        low: Vec3::ZERO,
        high: Vec3::ONE,
        seed: 0,
    };
    assert!(named(&|m| m.noise = Some(Noise { size: Vec3::X, ..noise })).contains("a size of the noise"), "no size");
    assert!(named(&|m| m.noise = Some(Noise { octaves: 0, ..noise })).contains("octaves"), "no octaves");
    assert!(named(&|m| m.noise = Some(Noise { distortion: f32::NAN, ..noise })).contains("distortion"), "not a number");
    assert!(named(&|m| m.noise = Some(Noise { high: Vec3::splat(2.0), ..noise })).contains("a colour"), "above 1");
    let glass = SpecularKind::Dielectric { ior: 0.0, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
    assert!(named(&|m| m.specular = glass).contains("refractive index"), "an index of 0");
    assert!(
        named(&|m| m.specular = SpecularKind::Ggx { alpha: 0.0, reflectance: Vec3::ONE, schlick: false })
            .contains("roughness"),
        "a width of 0"
    );
    let camera = Some(Camera { eye: Vec3::ONE, at: Vec3::ONE, up: Vec3::Y, fov_y_degrees: 40.0 });
    let error = Scene::new(Description { camera, ..Description::default() }).map(|_| ()).unwrap_err();
    assert_eq!(error, BuildError::Camera("eye and at are the same point"), "a camera that looks nowhere");
}

#[test]
fn pictures_are_refused_by_what_they_are_for() {
    let textured = |emission: f32, value: f32, diffuse_texture: Option<u32>| {
        let emission = Vec3::splat(emission);
        let material = Material { emission, emission_texture: Some(0), diffuse_texture, ..Material::default() };
        let textures = vec![Texture::from_linear(1, 1, vec![Vec3::splat(value)])];
        let description = Description { materials: vec![material], textures, ..Description::default() };
        Scene::new(description).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(textured(1.0, 9.0, None), Ok(()), "a bright screen");
    assert!(textured(1.0, 9.0, Some(0)).unwrap_err().contains("not in [0, 1]"), "a reflectance of 9");
    assert!(textured(1.0, -1.0, None).unwrap_err().contains("negative"), "negative light");
    assert!(textured(1e30, 1e30, None).unwrap_err().contains("times its texture"), "more light than there can be");
}
