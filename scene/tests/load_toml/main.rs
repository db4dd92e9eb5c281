//! Scene files: what each field does, and every fault refused by file and line.

#[path = "../common/mod.rs"]
mod common;
mod faults;

use std::time::{Duration, Instant};

use common::{assert_refused, load_files};
use scene::freeform::{Operation, Psi};
use scene::glam::{DVec3, UVec2, Vec3, Vec3A};
use scene::{FileSettings, LoadOptions, Loaded, Noise, Pattern, Projection, PunctualLight, Ray, Scene, SpecularKind};

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
fn text_of_a_solid_is_read_back() {
    let parts = "[{ quadric.sphere = { center = [0.1, 0, 0], radius = 1 }, perturbations = [{ quadric.slab = { point = [0, 0.3, 0], normal = [0, 1, 0], half_thickness = 0.2 }, factor = -0.7 }] }, { quadric.cylinder = { point = [0, 0, 0], axis = [1, 0, 0], radius = 0.5 } }]";
    let solid = |file: &str| loaded(file).description.forms.remove(0).solid;
    let described = solid(&format!("[[form]]\npsi.blend.width = 0.3\ndifference = {parts}\nrotate = [0, 20, 0]\n"));
    let again = solid(&format!("[[form]]\ntext = \"\"\"\n{described}\n\"\"\"\n"));
    assert_eq!(described, again, "all of it");
    let part = solid(&format!(
        "[[form]]\nunion = [{{ text = \"\"\"{described}\"\"\", translate = [1, 0, 0] }}]\nclip = {{ min = [-9, -9, -9], max = [9, 9, 9] }}\n"
    ));
    let p = DVec3::new(0.2, 0.4, 0.6);
    assert!((part.value(p + DVec3::X) - described.value(p)).abs() < 1e-12, "as a part, moved and clipped");
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
    let mut read: Vec<_> = scene.files.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    read.sort_unstable();
    assert_eq!(read, ["a.toml", "b.toml", "m.OBJ", "m.obj", "m.toml"], "each file once");

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
    let load_embedded =
        |text: &str, files: &[(&str, &[u8])]| scene::load_embedded(text, files, &LoadOptions::default());
    let text = format!("{TRIANGLE}[[mesh]]\nfile = \"m.obj\"\n");
    let obj: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(load_embedded(&text, &[("m.obj", obj)]).unwrap().description.meshes.len(), 2, "both meshes");
    let error = load_embedded(&text, &[("n.obj", obj)]).unwrap_err().to_string();
    assert!(error.starts_with("embedded.toml:5: 'm.obj' is not among the embedded files"), "{error}");
    let error =
        load_embedded(&format!("[environment]\nfile = \"/etc/passwd\"\n{TRIANGLE}"), &[]).unwrap_err().to_string();
    assert!(error.contains("embedded.toml:2: "), "{error}");
}

#[test]
fn surroundings_of_the_callers_choice_are_mended_for_embedded_scenes_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.exr");
    exr::prelude::write_rgb_file(&path, 2, 1, |x, _| if x == 0 { (f32::NAN, 1.0, -1.0) } else { (2.0, 2.0, 2.0) })
        .unwrap();
    let options = LoadOptions { environment: Some(path), environment_scale: 3.0 };
    let loaded = scene::load_embedded(TRIANGLE, &[], &options).unwrap();
    let surroundings = loaded.description.environment.unwrap();
    // The left half of the picture is on the side of +x.
    assert_eq!([Vec3A::X, Vec3A::NEG_X].map(|wi| surroundings.radiance(wi)), [Vec3::Y * 3.0, Vec3::splat(6.0)]);
    assert!(loaded.warnings.iter().any(|line| line.contains("NaN")), "{:?}", loaded.warnings);
}

#[test]
fn holes_of_what_a_ray_leaves_are_few_however_long_it_is() {
    // The place of a crossing is known to some 1e-16 of the ray's length.
    let scene = loaded(
        "[[material]]\nname = 'veil'\nopacity = 0.5\n[[form]]\nmaterial = 'veil'\n\
        complement = { quadric.one_sheet = { center = [0, 0, 0], axis = [0, 1, 0], radius = 9, slope = 1 } }\n\
        clip = { min = [-10, -10, -10], max = [10, 10, 10] }\n",
    );
    let scene = Scene::new(scene.description).expect("a right scene");
    let direction = |i: u32| {
        let (angle, height) = (f64::from(i) * 2.4, f64::from(i % 100) / 50.0 - 0.99);
        DVec3::new(angle.cos(), height, angle.sin()).normalize().as_vec3a()
    };
    let rays = (0..300).filter_map(|i| {
        let inwards = Ray { t_max: 1e9, ..Ray::new(20.0 * direction(i), -direction(i)) };
        let surface = scene.holes(&inwards, f32::INFINITY).next()?;
        Some(Ray { t_max: 1e9, ..surface.spawn(direction(7 * i + 1)) })
    });
    let most = rays.map(|ray| scene.holes(&ray, f32::INFINITY).count()).max();
    assert!((1..9).contains(&most.expect("the form is met")), "{most:?}");
}

#[test]
fn time_to_load_grows_as_the_file_does() {
    let count = 200_000;
    let faces = (0..count).map(|i| format!("[{}, {}, {}],\n", i % 4, (i + 1) % 4, (i + 2) % 4)).collect::<String>();
    let text = format!("[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]\nfaces = [\n{faces}]\n");
    let start = Instant::now();
    assert_eq!(loaded(&text).description.meshes[0].triangles.len(), count, "all faces");
    // A few seconds; with lines that are counted from the beginning for each face it was more than a minute.
    assert!(start.elapsed() < Duration::from_secs(40), "{:?} for {count} faces", start.elapsed());
    refused(&format!("{text}[[mesh]]\nmaterial = \"wood\""), count + 6, "no material 'wood'");
}
