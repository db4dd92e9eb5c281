//! Scene files: what each field does, and every fault refused by file and line.

mod common;

use common::{assert_refused, load_files};
use scene::freeform::{Operation, Psi};
use scene::glam::{DVec3, UVec2, Vec3, Vec3A};
use scene::{FileSettings, Loaded, Noise, Pattern, Projection, PunctualLight, SpecularKind, load_embedded};

const TRIANGLE: &str = "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";

fn loaded(text: &str) -> Loaded {
    load_files(&[("a.toml", text.as_bytes())]).unwrap_or_else(|error| panic!("{text:.300} is refused: {error}"))
}

/// Asserts that the triangle with `text` before it is refused at `line`.
fn refused(text: &str, line: usize, part: &str) {
    assert_refused(&[("a.toml", format!("{text}\n{TRIANGLE}").as_bytes())], &format!("a.toml:{line}: "), part);
}

#[test]
fn a_whole_scene_loads() {
    let scene = loaded(
        r#"
        version = 1
        film = { size = [640, 360], exposure = -0.5 }
        render = { quality = 2, spp = 64, seed = 7 }
        camera = { eye = [0, 1, 5], at = [0, 1, 0], fov = 35 }
        environment = { radiance = [1, 2, 3], scale = 0.5 }

        [[material]]
        name = "floor"
        gloss = { alpha = 0.15, reflectance = [0.9, 0.8, 0.7], schlick = true }
        [[material]]
        name = "glass"
        glass = { ior = 1.5, tint = 0.9, absorption = [0, 1, 2], priority = 3 }
        [[material]]
        name = "lamp"
        emission = 5
        opacity = 0.5

        [[mesh]]
        name = "square"
        material = "lamp"
        positions = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        uvs = [[0, 0], [1, 0], [1, 1], [0, 1]]
        faces = [[0, 1, 2, 3]]
        scale = [-2, 1, 1]
        rotate = [0, 90, 0]
        translate = [0, 0, 10]

        [[form]]
        name = "drop"
        material = "glass"
        quadric = { sphere = { center = [0, 0, 0], radius = 1 } }
        perturbations = [{ quadric.ellipsoid = { center = [1, 0, 0], radii = [0.5, 0.6, 0.7] }, factor = 0.25 }]
        translate = [0, 0, 3]

        [[form]]
        psi = "r_function"
        union = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 } }, { union = [{ quadric.sphere = { center = [3, 0, 0], radius = 1 } }] }]

        [[light]]
        point = { position = [1, 2, 3], intensity = 4 }
        [[light]]
        directional = { direction = [0, -2, 0], irradiance = [1, 1, 0.5] }
        "#,
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let settings = FileSettings {
        size: Some(UVec2::new(640, 360)),
        exposure: Some(-0.5),
        quality: Some(2.0),
        spp: Some(64),
        seed: Some(7),
    };
    assert_eq!(scene.settings, settings, "film and render");
    let description = scene.description;
    let camera = description.camera.expect("a camera");
    assert_eq!((camera.eye, camera.up, camera.fov_y_degrees), (Vec3::new(0.0, 1.0, 5.0), Vec3::Y, 35.0), "camera");
    let environment = description.environment.expect("surroundings");
    assert!((environment.radiance(Vec3A::X) - Vec3::new(0.5, 1.0, 1.5)).length() < 1e-6, "scaled");
    let materials = &description.materials;
    assert_eq!(
        materials[0].specular,
        SpecularKind::Ggx { alpha: 0.15, reflectance: Vec3::new(0.9, 0.8, 0.7), schlick: true },
        "gloss"
    );
    let absorption = Vec3::new(0.0, 1.0, 2.0);
    assert_eq!(
        materials[1].specular,
        SpecularKind::Dielectric { ior: 1.5, tint: Vec3::splat(0.9), absorption, priority: 3 },
        "glass"
    );
    assert_eq!((materials[2].emission, materials[2].opacity), (Vec3::splat(5.0), 0.5), "lamp");
    let mesh = &description.meshes[0];
    // Scaled by -2, (1, 0, 0) is turned about y from -2x to 2z; the mirrored square still faces away from its old back.
    assert!((mesh.positions[1] - Vec3::new(0.0, 0.0, 12.0)).length() < 1e-6, "{:?}", mesh.positions);
    let [a, b, c] = mesh.triangles[0].map(|i| mesh.positions[i as usize]);
    assert!((b - a).cross(c - a).x > 0.0, "the front stays the front");
    assert_eq!(mesh.uv_indices, mesh.triangles, "uvs go with positions");
    let drop = &description.forms[0].solid;
    assert!(drop.value(DVec3::new(0.0, 0.0, 3.9)) > 0.0 && drop.value(DVec3::ZERO) < 0.0, "moved");
    assert!(drop.value(DVec3::new(1.01, 0.0, 3.0)) > 0.0, "swollen at the right");
    let union = &description.forms[1].solid;
    assert_eq!((union.operation(), union.form_count()), (Some((Operation::Union, Psi::RFunction)), 2), "nested union");
    assert_eq!(materials[description.forms[1].material as usize].diffuse, Vec3::splat(0.5), "grey without a material");
    assert!(matches!(description.lights[0], PunctualLight::Point { .. }), "point");
    let expected = PunctualLight::Directional { direction: -Vec3::Y, irradiance: Vec3::new(1.0, 1.0, 0.5) };
    assert_eq!(description.lights[1], expected, "directional");
}

#[test]
fn all_named_quadrics_load() {
    for (quadric, inside, outside) in [
        ("ellipsoid = { center = [1, 0, 0], radii = [1, 2, 3] }", [1.0, 1.9, 0.0], [1.0, 2.1, 0.0]),
        ("sphere = { center = [1, 0, 0], radius = 2 }", [2.9, 0.0, 0.0], [3.1, 0.0, 0.0]),
        ("cylinder = { point = [1, 0, 0], axis = [0, 2, 0], radius = 2 }", [2.9, 99.0, 0.0], [3.1, 0.0, 0.0]),
        ("cone = { apex = [0, 0, 0], axis = [0, 1, 0], slope = 0.5 }", [0.9, 2.0, 0.0], [1.1, 2.0, 0.0]),
        (
            "paraboloid = { vertex = [0, 0, 0], axis = [0, 1, 0], focal_length = 0.25 }",
            [1.9, 4.0, 0.0],
            [2.1, 4.0, 0.0],
        ),
        (
            "one_sheet = { center = [1, 0, 0], axis = [0, 1, 0], radius = 2, slope = 1 }",
            [2.9, 0.0, 0.0],
            [3.1, 0.0, 0.0],
        ),
        (
            "two_sheets = { center = [1, 0, 0], axis = [0, 1, 0], height = 2, slope = 1 }",
            [1.0, 2.1, 0.0],
            [1.0, 1.9, 0.0],
        ),
        (
            "saddle = { point = [0, 1, 0], axis = [0, 1, 0], along = [1, 0, 0], rise = 1, fall = 2 }",
            [1.0, 1.9, 0.0],
            [0.0, -0.9, 1.0],
        ),
        ("plane = { point = [0, 1, 0], normal = [0, 3, 0] }", [7.0, 0.9, 7.0], [7.0, 1.1, 7.0]),
        ("half_space = { point = [0, 1, 0], normal = [0, 3, 0] }", [7.0, 0.9, 7.0], [7.0, 1.1, 7.0]),
        ("slab = { point = [0, 1, 0], normal = [0, 1, 0], half_thickness = 0.5 }", [7.0, 0.6, 0.0], [7.0, 0.4, 0.0]),
        ("coefficients = [-1, -1, -1, 0, 0, 0, 0, 0, 0, 4]", [1.9, 0.0, 0.0], [2.1, 0.0, 0.0]),
    ] {
        let solid = &loaded(&format!("[[form]]\nquadric = {{ {quadric} }}\n")).description.forms[0].solid.clone();
        assert!(solid.value(inside.into()) > 0.0, "{quadric}: inside");
        assert!(solid.value(outside.into()) < 0.0, "{quadric}: outside");
    }
}

#[test]
fn projections_and_noise_load() {
    let text = r#"
        [[material]]
        name = "stone"
        noise = { pattern = "marble", size = [0.5, 1, 2], octaves = 6, distortion = 3, low = [0.1, 0.2, 0.3], seed = -4 }
        [[form]]
        material = "stone"
        quadric.sphere = { center = [0, 0, 0], radius = 1 }
        projection.box = { center = [1, 2, 3], size = 0.5 }
        translate = [0, 0, 10]
        [[form]]
        quadric.sphere = { center = [0, 0, 0], radius = 1 }
        projection.spherical = { front = [1, 0, 0] }
        [[form]]
        quadric.plane = { point = [0, 0, 0], normal = [0, 1, 0] }
        projection.planar = { right = [2, 0, 0], up = [0, 0, -2] }
        "#;
    let Loaded { description, warnings, .. } = loaded(text);
    assert!(warnings.is_empty(), "{warnings:?}");
    let stone = &description.materials[0];
    let noise = Noise {
        pattern: Pattern::Marble,
        size: Vec3::new(0.5, 1.0, 2.0),
        octaves: 6,
        distortion: 3.0,
        low: Vec3::new(0.1, 0.2, 0.3),
        high: Vec3::ONE,
        seed: -4,
    };
    assert_eq!((stone.noise, stone.diffuse), (Some(noise), Vec3::ONE), "noise, over an albedo of 1 that is not grey");
    let shapes: Vec<_> = description.forms.iter().map(|form| form.projection.unwrap()).collect();
    assert_eq!(shapes[0], Projection::cube(DVec3::new(1.0, 2.0, 13.0), 0.5), "moved with its form");
    assert_eq!(
        Some(shapes[1]),
        Projection::spherical(DVec3::ZERO, DVec3::Y, DVec3::X),
        "the axis is y if none is given"
    );
    let right_and_up = (DVec3::X * 2.0, DVec3::Z * -2.0);
    assert_eq!(Some(shapes[2]), Projection::planar(DVec3::ZERO, right_and_up.0, right_and_up.1), "at the origin");
}

#[test]
fn repeated_forms_stand_in_rows_and_at_random_turns() {
    let form = |repeat: &str| {
        let text = format!(
            "[[form]]\nquadric.ellipsoid = {{ center = [0.5, 0, 0], radii = [0.5, 0.2, 0.2] }}\nrotate = [0, 90, 0]\ntranslate = [1, 2, 3]\nrepeat = {{ {repeat} }}\n"
        );
        loaded(&text).description.forms.remove(0)
    };
    // The form reaches from (1, 2, 3) a metre along -z.
    let tip = DVec3::new(1.0, 2.0, 2.0);
    let plain = form("count = [2, 1, 3], step = [10, 20, 30]");
    assert!(
        plain.solid.value(tip + DVec3::Z * 0.01) > 0.0 && plain.solid.value(tip - DVec3::Z * 0.01) < 0.0,
        "where it is"
    );
    let tips: Vec<DVec3> = plain.copies.iter().map(|copy| copy.transform_point3(tip)).collect();
    let expected = [(0.0, 0.0), (10.0, 0.0), (0.0, 30.0), (10.0, 30.0), (0.0, 60.0), (10.0, 60.0)];
    let expected: Vec<DVec3> = expected.map(|(x, z)| tip + DVec3::new(x, 0.0, z)).to_vec();
    assert_eq!(tips, expected, "along x, then z, the first in its place");
    let text = "count = [30, 30, 1], step = [10, 10, 10], jitter = [1, 0, 2], turn = [0, 180, 0], size = [0.5, 2]";
    let wild = form(text);
    let (mut low, mut high, mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY, f64::INFINITY, 0.0_f64);
    for (index, copy) in (0..900).zip(&wild.copies) {
        let place = DVec3::new(1.0, 2.0, 3.0) + DVec3::new(f64::from(index % 30), f64::from(index / 30), 0.0) * 10.0;
        let shift = copy.transform_point3(DVec3::new(1.0, 2.0, 3.0)) - place;
        let axis = copy.transform_vector3(tip - DVec3::new(1.0, 2.0, 3.0));
        (low, high) = (low.min(shift), high.max(shift));
        (least, most) = (least.min(axis.length()), most.max(axis.length()));
        assert!(axis.y.abs() < 1e-12, "turned about y alone: {axis}");
    }
    assert!(
        low.cmpge(DVec3::new(-1.0, -1e-9, -2.0)).all() && high.cmple(DVec3::new(1.0, 1e-9, 2.0)).all(),
        "{low} {high}"
    );
    assert!(low.x < -0.95 && low.z < -1.9 && high.x > 0.95 && high.z > 1.9, "all of the jitter is used: {low} {high}");
    assert!((0.5..0.52).contains(&least) && (1.98..2.0).contains(&most), "and all sizes: {least} to {most}");
    assert_eq!(wild.copies, form(text).copies, "the same again");
    assert_ne!(wild.copies, form(&format!("{text}, seed = 1")).copies, "another seed, other copies");
}

#[test]
fn faults_are_refused_by_line_and_field() {
    for (text, line, part) in [
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfovv = 3", 4, "unknown field 'fovv'; write 'fov'"),
        ("[kamera]\neye = [0, 0, 1]", 1, "unknown field 'kamera'; write 'camera'"),
        ("[camera]\neye = [0, 0, 1]", 1, "missing field `at`"),
        ("[film]\nsize = [0, 9]", 2, "size: 0 at index 0 is out of range; give numbers from 1.0 to 16384.0"),
        ("film = { size = [1000000000, 1] }", 1, "size: 1000000000 at index 0 is out of range"),
        ("film = { size = [16384, 16385] }", 1, "size: 16385 at index 1 is out of range"),
        ("film = { size = [1.5, 2] }", 1, "1.5 is not a whole number"),
        ("film = { size = 7 }", 1, "1 numbers where 2 are needed"),
        ("film = { exposure = nan }", 1, "exposure: NaN is out of range"),
        ("[render]\nspp = -1", 2, "spp: -1 is out of range; give numbers from 1.0 to 1048576.0"),
        ("[render]\nspp = 0", 2, "spp: 0 is out of range"),
        ("[render]\nspp = 1e12", 2, "spp: 1000000000000 is out of range"),
        ("[render]\nspp = 2.5", 2, "spp: 2.5 is not a whole number"),
        ("[render]\nspp = \"many\"", 2, "spp: invalid type: string \"many\""),
        ("[render]\nspp = 4\n\nspp = 5", 4, "duplicate key 'spp'; keep one"),
        ("[render]\nquality = inf", 2, "quality: inf is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfov = 0", 4, "fov: 0 is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfov = 180", 4, "fov: 180 is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfov = nan", 4, "fov: NaN is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 1]", 1, "eye and at are the same point"),
        ("[camera]\neye = [0, 5, 0]\nat = [0, 0, 0]", 1, "up is parallel to the view"),
        ("[camera]\neye = [0, 5, 0]\nat = [0, 0, 0]\nup = [0, 0, 0]", 4, "a direction of length zero"),
        ("[camera]\neye = [0, 5]\nat = [0, 0, 0]", 2, "eye: 2 numbers where 3 are needed"),
        ("[camera]\neye = [0, 5, inf]\nat = [0, 0, 0]", 2, "eye: inf at index 2 is out of range"),
        ("camera = 3", 1, "camera: invalid type"),
        ("[[form]]\nquadric.coefficients = [1, 2, 3, 4, 5, 6, 7, 8, 9]", 2, "9 numbers where 10 are needed"),
        (
            "[[form]]\nquadric.coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
            2,
            "all ten coefficients of a quadric are zero",
        ),
        ("[[form]]\nquadric.coefficients = [0, 0, 0, 0, inf, 0, 0, 0, 0, 0]", 2, "inf at index 4 is out of range"),
        ("[[form]]\nquadric.coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, nan]", 2, "NaN at index 9 is out of range"),
        (
            "[[form]]\nquadric.elipsoid = { center = [0, 0, 0], radii = 1 }",
            2,
            "unknown field 'elipsoid'; write 'ellipsoid'",
        ),
        ("[[form]]\nquadric.sphere = { center = [0, 0, 0], radiu = 1 }", 2, "unknown field 'radiu'; write 'radius'"),
        ("[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 0 }", 2, "radius: 0 is out of range"),
        ("[[form]]\nname = \"x\"", 1, "a form without a quadric"),
        ("[[form]]\nunion = []", 1, "no parts in the union"),
        (
            "[[form]]\npsi = \"min\"\nunion = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 } }]",
            2,
            "unknown field 'min'",
        ),
        (
            "[[form]]\nunion = [\n{ quadric.sphere = { center = [0, 0, 0], radius = 1 } },\n{ },\n]",
            4,
            "a form without a quadric",
        ),
        ("[[form]]\ndifference = [\n]", 1, "no parts in the difference"),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nclip = { min = [0, 0, 0], max = [1, 0, 1] }",
            3,
            "a clip without inside",
        ),
        (
            "[[form]]\ncomplement = { quadric.sphere = { center = [0, 0, 0], radius = 1 } }\nunion = []",
            1,
            "both union and complement",
        ),
        (
            "[[form]]\npsi = { blend = { width = 0 } }\nunion = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 } }]",
            2,
            "width: 0 is out of range",
        ),
        (
            "[[form]]\nquadric.coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
            2,
            "all ten coefficients of a quadric are zero",
        ),
        ("[[form]]\nquadric.coefficients = [1, 0, 0, 0, nan, 0, 0, 0, 0, 0]", 2, "NaN at index 4 is out of range"),
        ("[[form]]\nscale = 0\nquadric.sphere = { center = [0, 0, 0], radius = 1 }", 2, "the scale is zero"),
        ("[[light]]\npoint = { position = [0, 0, 0], intensity = -1 }", 2, "intensity: -1 is out of range"),
        ("[[light]]\ndirectional = { direction = [0, 0, 0], irradiance = 1 }", 2, "a direction of length zero"),
        ("[[light]]\nspot = { }", 2, "unknown field 'spot'"),
        ("[[material]]\nname = \"a\"\nemission = [0, -1, 0]", 3, "emission: -1 at index 1 is out of range"),
        ("[[material]]\nname = \"a\"\ndiffuse = 2", 3, "diffuse: 2 is out of range; give numbers from 0.0 to 1.0"),
        (
            "[[material]]\nname = \"a\"\nmirror.reflectance = 1\nglass.ior = 1.5",
            2,
            "more than one of gloss, mirror and glass",
        ),
        ("[[material]]\nname = \"a\"\nglass.ior = 0", 3, "ior: 0 is out of range"),
        ("[[material]]\nname = \"a\"\nnoise.pattern = \"clouds\"", 3, "missing field `size`"),
        ("[[material]]\nname = \"a\"\nnoise = { pattern = \"cloud\", size = 1 }", 3, "write 'clouds'"),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = [1, 0, 1] }",
            3,
            "size: 0 at index 1 is out",
        ),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, octaves = 11 }",
            3,
            "octaves: 11 is out of",
        ),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, octaves = 1.5 }",
            3,
            "not a whole number",
        ),
        ("[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, low = 2 }", 3, "low: 2 is out of range"),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, distortion = inf }",
            3,
            "distortion: inf",
        ),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"clouds\", size = 1, distortion = 1 }",
            3,
            "clouds with a dist",
        ),
        ("[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, seed = 0.5 }", 3, "seed: invalid type"),
        ("[[form]]\nrepeat = { count = [1, 0, 1], step = [1, 1, 1] }", 2, "count: 0 at index 1 is out of range"),
        ("[[form]]\nrepeat = { count = [1, 1.5, 1], step = [1, 1, 1] }", 2, "count: 1.5 is not a whole number"),
        ("[[form]]\nrepeat = { count = [1, 1, 1] }", 2, "missing field `step`"),
        (
            "[[form]]\nrepeat = { count = [1, 1, 1], step = [1, 1, 1], size = [2, 1] }",
            2,
            "size: from 2 to 1; give the smaller",
        ),
        (
            "[[form]]\nrepeat = { count = [1, 1, 1], step = [1, 1, 1], sied = 1 }",
            2,
            "unknown field 'sied'; write 'seed'",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nrepeat = { count = [4194304, 4194304, 4194304], step = [1, 1, 1] }",
            3,
            "copies, more than the limit of 4194304; lower a count",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nrepeat = { count = [101, 1, 1], step = [1e7, 1, 1] }",
            3,
            "repeated beyond the limit of 1e9 metres",
        ),
        (
            "[[form]]\nquadric.plane = { point = [0, 0, 0], normal = [0, 1, 0] }\nrepeat = { count = [1, 2, 1], step = [1, 1, 1] }",
            3,
            "an unbounded form repeated; clip it",
        ),
        ("[[form]]\nprojection.sphere = { }", 2, "unknown field 'sphere'; write 'spherical'"),
        ("[[form]]\nprojection.planar = { right = [1, 0, 0] }", 2, "missing field `up`"),
        ("[[form]]\nprojection.box = { size = 0 }", 2, "size: 0 is out of range"),
        ("[[form]]\nprojection.box = { size = 1, sise = 1 }", 2, "unknown field 'sise'; write 'size'"),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nprojection.planar = { right = [1, 0, 0], up = [-2, 0, 0] }",
            3,
            "right and up are parallel",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nprojection.spherical = { axis = [0, 0, 3] }",
            3,
            "front is parallel to the axis",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nprojection.spherical = { axis = [0, 0, 0] }",
            3,
            "a direction of length zero",
        ),
        ("[[material]]\nname = \"a\"\n[[material]]\nname = \"a\"", 4, "two materials 'a'"),
        ("[[material]]\ndiffuse = 0.5", 1, "missing field `name`"),
        ("[[material]]\nname = \"a\"\ndiffuse_texture = \"none.png\"", 3, "'none.png' cannot be read"),
        ("[[mesh]]\nfile = \"none.obj\"", 2, "'none.obj' cannot be read"),
        ("[[mesh]]\nfile = \".\"", 2, "is not a regular file"),
        ("[[mesh]]\nname = \"empty\"", 1, "a mesh without positions or faces"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2],\n[0, 1, 7]]",
            4,
            "face index 7 is out of range, there are 3",
        ),
        ("[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1]]", 3, "a face of 2 corners"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, -1, 2]]",
            3,
            "invalid value: integer `-1`",
        ),
        ("[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\nfaces = [[0, 1, 2]]", 1, "zero area"),
        ("[[mesh]]\npositions = [[0, 0, nan]]\nfaces = [[0, 0, 0]]", 2, "positions: NaN at index 2 is out of range"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nuvs = [[0, 0]]\nfaces = [[0, 1, 2]]",
            1,
            "1 uvs for 3 positions",
        ),
        ("[[mesh]]\nmaterial = \"whit\"\n[[material]]\nname = \"white\"", 2, "no material 'whit'; write 'white'"),
        ("[environment]\nscale = 2", 1, "either file or radiance"),
        ("[environment]\nradiance = 1e20\nscale = 1e30", 1, "the environment times"),
        ("[environment]\nfile = \"none.exr\"", 2, "'none.exr' cannot be read"),
        ("include = [\n\"none.toml\",\n]", 2, "'none.toml"),
        ("version = 2", 1, "version 2 of the scene file, only 1 is known"),
        ("a = ", 1, ""),
        ("[camera\neye = 3", 1, "unclosed table"),
    ] {
        refused(text, line, part);
    }
    assert_refused(&[("a.toml", b"")], "a.toml: nothing to see", "");
    assert_refused(&[("a.toml", b"version = 1\n# \xff")], "a.toml:2: it is not text", "");
    assert_refused(&[("a.toml", &[0; 9])], "a.toml:1: ", "");
}

#[test]
fn forms_that_shine_are_bounded() {
    let lamp = "[[material]]\nname = \"lamp\"\nemission = 1\n";
    let form = |quadric: &str| format!("{lamp}[[form]]\nmaterial = \"lamp\"\nquadric = {{ {quadric} }}\n");
    refused(&form("half_space = { point = [0, 0, 0], normal = [0, 1, 0] }"), 4, "an unbounded form that shines");
    let ball = loaded(&form("sphere = { center = [0, 0, 0], radius = 1 }"));
    assert!(ball.description.environment.is_none(), "a shining ball is a light, no sky is needed");
}

#[test]
fn deep_nesting_is_refused() {
    let depth = 1_000_000;
    refused(&format!("a = {}", "[".repeat(depth)), 1, "nested too deep");
    refused(&format!("[[form]]\nunion = {}", "[{union=".repeat(depth)), 2, "nested too deep");
    let ball = "[{quadric.sphere={center=[0,0,0],radius=1}}]";
    let nested =
        |depth: usize| format!("[[form]]\nunion = {}{ball}{}\n", "[{union=".repeat(depth - 1), "}]".repeat(depth - 1));
    assert_eq!(loaded(&nested(32)).description.forms[0].solid.form_count(), 1, "32 unions");
    refused(&nested(33), 1, "set operations are nested deeper than 32");
}

#[test]
fn includes_are_merged_and_circles_refused() {
    let part = "include = [\"../c/m.toml\"]\n[[mesh]]\nfile = \"m.obj\"\nmaterial = \"red\"\n[camera]\neye = [0, 0, 9]\nat = [0, 0, 0]\n";
    let obj: &[u8] = b"mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    let files: [(&str, &[u8]); 4] = [
        ("a.toml", b"include = [\"b/b.toml\", \"b/m.OBJ\", \"c/m.toml\"]\n"),
        ("b/b.toml", part.as_bytes()),
        ("c/m.toml", b"[[material]]\nname = \"red\"\ndiffuse = [1, 0, 0]\n"),
        ("b/m.obj", obj),
    ];
    let mut files = files.to_vec();
    files.push(("b/m.OBJ", obj));
    let scene = load_files(&files).unwrap();
    assert_eq!(scene.description.meshes.len(), 2, "one by its scene file, one as it is");
    let red: Vec<bool> = scene
        .description
        .meshes
        .iter()
        .map(|mesh| scene.description.materials[mesh.materials[0] as usize].diffuse == Vec3::X)
        .collect();
    assert_eq!(red.iter().filter(|&&red| red).count(), 1, "a material of another file");
    assert!(scene.description.camera.is_some(), "the camera of an included file");

    assert_refused(&[("a.toml", b"include = [\"a.toml\"]")], "a.toml:1: ", "includes itself");
    let circle: [(&str, &[u8]); 3] = [
        ("a.toml", b"include = ['b.toml']"),
        ("b.toml", b"\ninclude = ['c.toml']"),
        ("c.toml", b"include = ['./a.toml']"),
    ];
    assert_refused(&circle, "c.toml:1: ", "includes itself; break the circle");
    let many = format!("include = [{}]", "'b.toml',".repeat(1001));
    assert_refused(&[("a.toml", many.as_bytes()), ("b.toml", b"")], "a.toml:1: more than 1000 files", "");
}

#[test]
fn a_thousand_files_in_a_chain_load() {
    let names: Vec<String> = (0..900).map(|i| format!("{i}.toml")).collect();
    let texts: Vec<String> =
        (1..=900).map(|i| if i < 900 { format!("include = ['{i}.toml']") } else { TRIANGLE.to_owned() }).collect();
    let files: Vec<(&str, &[u8])> = names.iter().map(String::as_str).zip(texts.iter().map(String::as_bytes)).collect();
    assert_eq!(load_files(&files).unwrap().description.meshes.len(), 1, "without recursion");
}

#[test]
fn an_obj_is_read_once_for_all_its_places() {
    let obj: &[u8] = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    let text = "[[mesh]]\nfile = 'm.obj'\n[[mesh]]\nfile = './m.obj'\ntranslate = [1, 0, 0]\n[[mesh]]\nfile = 'm.obj'\nscale = 3\n";
    let scene = load_files(&[("a.toml", text.as_bytes()), ("m.obj", obj), ("m.mtl", b"newmtl m\nKd 1 0 0")]).unwrap();
    let description = scene.description;
    assert_eq!((description.meshes.len(), description.materials.len()), (3, 1), "three places, one material");
    let second: Vec<Vec3> = description.meshes.iter().map(|mesh| mesh.positions[1]).collect();
    assert_eq!(second, [Vec3::X, Vec3::X * 2.0, Vec3::X * 3.0], "as it is, moved, scaled");
}

#[test]
fn embedded_scenes_reach_nothing_else() {
    let text = format!("{TRIANGLE}[[mesh]]\nfile = \"m.obj\"\n");
    let obj: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(load_embedded(&text, &[("m.obj", obj)]).unwrap().description.meshes.len(), 2, "both meshes");
    let error = load_embedded(&text, &[("n.obj", obj)]).unwrap_err().to_string();
    assert!(error.starts_with("embedded.toml:5: 'm.obj' is not among the embedded files"), "{error}");
    let error =
        load_embedded(&format!("[environment]\nfile = \"/etc/passwd\"\n{TRIANGLE}"), &[]).unwrap_err().to_string();
    assert!(error.contains("embedded.toml:2: "), "{error}");
}
