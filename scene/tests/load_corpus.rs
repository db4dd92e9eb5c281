//! The scenes and the damaged files of tests/data: each loads or is refused with one line, in little time and memory.

mod common;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use scene::{LoadOptions, Loaded, SpecularKind, load};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

/// Loads within the limits; the error comes as text.
fn try_load(path: &Path, options: &LoadOptions) -> Result<Loaded, String> {
    let start = Instant::now();
    let result = load(path, options).map_err(|error| common::text_of(&error, path.parent().expect("a folder")));
    let time = start.elapsed();
    if let Ok(loaded) = &result {
        common::assert_builds(loaded);
    }
    assert!(time < Duration::from_secs(10), "{} takes {time:?}", path.display());
    assert!(peak_bytes() < 512 << 20, "{} takes {} bytes", path.display(), peak_bytes());
    result
}

/// The peak memory of this process, where the system tells it in /proc.
fn peak_bytes() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<usize>().ok())
        .map_or(0, |kilobytes| kilobytes << 10)
}

fn files_in(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(data(folder)).expect("tests/data is complete");
    let mut files: Vec<PathBuf> =
        entries.map(|entry| entry.expect("an entry").path()).filter(|path| !path.ends_with("LICENSE.txt")).collect();
    files.sort();
    files
}

#[test]
fn damaged_exr_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("a.obj");
    std::fs::write(&scene, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let files = files_in("damaged-exr");
    assert_eq!(files.len(), 34, "all are there");
    for file in files {
        let options = LoadOptions { environment: Some(file.clone()), ..LoadOptions::default() };
        // The text names the file with its folder, which is not the scene's.
        if let Err(text) = try_load(&scene, &options) {
            assert!(text.starts_with(&format!("{}: ", file.display())), "{text}");
        }
    }
}

/// What each odd file comes to: its triangles, or the start of its message.
const ODD: &[(&str, &str)] = &[
    ("tinyobjloader/catmark_torus_creases0.obj", "64 triangles"),
    ("tinyobjloader/colorspace-issue-184.obj", "colorspace-issue-184.mtl:6: 'diffuse.jpg' cannot be read"),
    ("tinyobjloader/cornell_box_multimaterial.obj", "36 triangles"),
    ("tinyobjloader/cube-vertex-w-component.obj", "12 triangles"),
    ("tinyobjloader/cube-vertexcol.obj", "12 triangles"),
    ("tinyobjloader/fuzz-4877060179886080", "a.obj:1: it is not text"),
    ("tinyobjloader/invalid-face-definition.obj", "invalid-face-definition.obj: no faces"),
    (
        "tinyobjloader/invalid-relative-texture-index.obj",
        "invalid-relative-texture-index.obj:2: texture coordinate index -2",
    ),
    ("tinyobjloader/invalid-relative-vertex-index.obj", "invalid-relative-vertex-index.obj:1: vertex index -4"),
    ("tinyobjloader/issue-138.obj", "12 triangles"),
    ("tinyobjloader/issue-140-zero-face-idx.obj", "issue-140-zero-face-idx.obj:16: vertex index 0"),
    ("tinyobjloader/issue-161-inconsistent-f.obj", "12 triangles"),
    ("tinyobjloader/issue-235-usemtl-then-o.obj", "2 triangles"),
    ("tinyobjloader/issue-246-usemtl-whitespace.obj", "1 triangles"),
    ("tinyobjloader/issue-295-trianguation-failure.obj", "28 triangles"),
    ("tinyobjloader/issue-319-002.obj", "14 triangles"),
    ("tinyobjloader/issue-330.obj", "3 triangles"),
    ("tinyobjloader/issue-356-leading-spaces-newmtl.obj", "issue-356-leading-spaces-newmtl.obj: no faces"),
    ("tinyobjloader/issue-92.obj", "issue-92.mtl:5: 'tmp.png' cannot be read"),
    ("tinyobjloader/leading-decimal-dot-issue-201.obj", "1 triangles"),
    ("tinyobjloader/leading-zero-in-exponent-notation-issue-210.obj", "1 triangles"),
    ("tinyobjloader/line-prim.obj", "line-prim.obj: no faces"),
    ("tinyobjloader/missing_material_file.obj", "36 triangles"),
    ("tinyobjloader/mtl filename with whitespace issue46.obj", "12 triangles"),
    ("tinyobjloader/mtllib-multiple-files-issue-112.obj", "mtllib-multiple-files-issue-112.mtl:5: 'tmp.png' cannot"),
    ("tinyobjloader/no_material.obj", "36 triangles"),
    ("tinyobjloader/pbr-mat-ext.obj", "pbr-mat-ext.mtl:17: 'emissive.tex' cannot be read"),
    ("tinyobjloader/points-prim.obj", "points-prim.obj: no faces"),
    ("tinyobjloader/smoothing-group-two-squares.obj", "3 triangles"),
    ("tinyobjloader/test-nan.obj", "test-nan.obj:12: 'nan' is not a finite number"),
    ("tinyobjloader/texture-options-issue-85.obj", "texture-options-issue-85.mtl:7: 'diffuse.jpg' cannot be read"),
    ("tinyobjloader/usemtl-issue-104.obj", "6 triangles"),
    ("tobj/cornell_box.obj", "cornell_box2.mtl:20: 'dummy_texture.png' cannot be read"),
    ("tobj/empty_name_triangle.obj", "1 triangles"),
    ("tobj/invalid_index.obj", "invalid_index.obj:12: vertex index 7 is out of range, the file has 6"),
    ("tobj/lines.obj", "lines.obj: no faces"),
    ("tobj/quad.obj", "5 triangles"),
    ("tobj/quad_colored_merge.obj", "2 triangles"),
    ("tobj/triangle.obj", "1 triangles"),
    ("tobj/triangle_colored.obj", "1 triangles"),
];

#[test]
fn odd_obj_files_load_or_are_refused() {
    let is_scene = |path: &PathBuf| path.extension().is_none_or(|extension| extension != "mtl");
    let count = |folder| files_in(folder).iter().filter(|path| is_scene(path)).count();
    assert_eq!(count("odd-obj/tinyobjloader") + count("odd-obj/tobj"), ODD.len(), "all are in the table");
    for (name, expected) in ODD {
        let mut path = data("odd-obj").join(name);
        let folder = tempfile::tempdir().unwrap();
        if path.extension().is_none() {
            let copy = folder.path().join("a.obj");
            std::fs::copy(&path, &copy).unwrap();
            path = copy;
        }
        let found = match try_load(&path, &LoadOptions::default()) {
            Ok(loaded) => format!("{} triangles", loaded.description.meshes[0].triangles.len()),
            Err(text) => text,
        };
        assert!(found.starts_with(expected), "{name}: wanted {expected}; found {found}");
    }
}

#[test]
fn scenes_load_as_described() {
    let triangles = |loaded: &Loaded| loaded.description.meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
    for (name, count) in [
        ("cornell-box/cornell-box.obj", 36),
        ("water-caustic/water-caustic.obj", 103_487),
        ("spot/spot.obj", 5_856),
        ("study/cornell/scene.obj", 36),
        ("study/cornell-glossy/scene.obj", 36),
        ("study/atrium-env/scene.obj", 1_458),
    ] {
        let loaded = try_load(&data(name), &LoadOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(triangles(&loaded), count, "{name}");
        assert!(loaded.warnings.is_empty(), "{name}: {:?}", loaded.warnings);
        assert_eq!(
            loaded.description.environment.is_some(),
            name.contains("spot") || name.contains("atrium"),
            "{name}: a sky where there is no light"
        );
    }
    let glossy = try_load(&data("study/cornell-glossy/scene.obj"), &LoadOptions::default()).unwrap();
    let floor = glossy.description.materials.iter().find(|material| material.name == "floor_ggx").expect("the floor");
    assert!(
        matches!(floor.specular, SpecularKind::Ggx { alpha, schlick: false, .. } if (alpha - 0.2).abs() < 1e-5),
        "{floor:?}"
    );
    let water = try_load(&data("water-caustic/water-caustic.obj"), &LoadOptions::default()).unwrap();
    assert!(
        water
            .description
            .materials
            .iter()
            .any(|material| matches!(material.specular, SpecularKind::Dielectric { ior: 1.8, .. })),
        "water"
    );
    let options = LoadOptions { environment: Some(data("study/atrium-env/env.exr")), environment_scale: 2.0 };
    let atrium = try_load(&data("study/atrium-env/scene.obj"), &options).unwrap();
    assert_eq!(atrium.description.environment.expect("surroundings").size(), (512, 510), "env.exr");
}

#[test]
fn the_default_scene_has_what_it_should_show() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cli/scenes/default.toml");
    let loaded = try_load(&path, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let description = loaded.description;
    assert!(
        description.camera.is_some() && description.environment.is_none(),
        "a camera, and a lamp in place of a sky"
    );
    let of = |name: &str| description.forms.iter().find(|form| form.name == name).expect("the form");
    assert_eq!(of("sculpture").solid.forms()[0].perturbations().len(), 3, "perturbations");
    assert_eq!(of("pair").solid.form_count(), 2, "a union of two");
    let glass = &description.materials[of("lens").material as usize];
    assert!(matches!(glass.specular, SpecularKind::Dielectric { ior: 1.5, .. }), "glass");
    let glossy =
        |material: &&scene::Material| matches!(material.specular, SpecularKind::Ggx { alpha, .. } if alpha <= 0.2);
    assert_eq!(description.materials.iter().filter(glossy).count(), 2, "two glossy materials");
    assert!(description.meshes.iter().any(|mesh| mesh.name == "vase" && mesh.triangles.len() > 200), "a mesh");
}
