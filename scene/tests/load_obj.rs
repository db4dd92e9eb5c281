//! OBJ files, odd and hostile: each loads with a sensible result or is refused by file and line.

mod common;

use common::{assert_refused, load_files};
use scene::glam::{Vec2, Vec3};
use scene::{Loaded, Mesh, NO_INDEX};

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn loaded(text: &str) -> Loaded {
    load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|error| panic!("{:.200} is refused: {error}", text))
}

fn area(mesh: &Mesh) -> f32 {
    let areas = mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
        (b - a).cross(c - a).length() / 2.0
    });
    areas.sum()
}

fn assert_warned(loaded: &Loaded, part: &str) {
    assert!(loaded.warnings.iter().any(|warning| warning.contains(part)), "wanted {part:?} in {:?}", loaded.warnings);
}

#[test]
fn rounding_far_from_the_origin_is_told() {
    // Two triangles of such a size, so far away.
    let warned = |size: f64, far: f64| {
        let corner = |x: f64, z: f64| format!("v {} {far} {}\n", far + size * x, size * z);
        let corners: String = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, z)| corner(x, z)).concat();
        let loaded = loaded(&format!("{corners}f 1 2 3\nf 2 4 3\n"));
        loaded.warnings.iter().any(|line| line.contains("so far from the origin that places are rounded to"))
    };
    assert!(!warned(1.0, 0.0) && !warned(100.0, 1e5) && !warned(1e-3, 1.0), "where it does not matter");
    assert!(warned(1.0, 5e6) && warned(10.0, 5e6) && warned(1e-3, 1e3), "where it does");
}

#[test]
fn faults_are_refused_by_line() {
    let table: &[(&str, usize, &str)] = &[
        ("f 0 1 2\n", 4, "index 0"),
        ("f 1 2 99\n", 4, "index 99 is out of range, the file has 3"),
        ("f 1 2 3\nf -1 -2 -9\n", 5, "before the start"),
        ("v 1 2\nf 1 2 3\n", 4, "2 numbers where 3 are needed"),
        ("v nan 0 0\nf 1 2 3\n", 4, "'nan' is not a finite number"),
        ("v 0 -inf 0\nf 1 2 3\n", 4, "'-inf' is not a finite number"),
        ("v 1e999 0 0\nf 1 2 3\n", 4, "'1e999' is not a finite number"),
        ("v 1 1e39 0\nf 1 2 3\n", 4, "'1e39' is beyond the limit"),
        ("v 1.#IND 0 0\nf 1 2 3\n", 4, "'1.#IND' is not a number"),
        ("v 0 0 1.#QNAN0\nf 1 2 3\n", 4, "'1.#QNAN0' is not a number"),
        ("vt -1.#IND00 -1.#IND00\nf 1 2 3\n", 4, "'-1.#IND00' is not a number"),
        ("v 1 x 0\nf 1 2 3\n", 4, "'x' is not a number"),
        ("vn nan 0 0\nf 1 2 3\n", 4, "not a finite number"),
        ("vt inf 0\nf 1 2 3\n", 4, "not a finite number"),
        ("vt 0 0\nf 1/1 2/9 3/1\n", 5, "texture coordinate index 9 is out of range, the file has 1"),
        ("f 1/1 2/9 3/1\n", 4, "texture coordinate index 9"),
        ("vn 0 0 1\nf 1//1 2//2 3//1\n", 5, "normal index 2 is out of range"),
        ("f 1/0 2/0 3/0\n", 4, "texture coordinate index 0"),
        ("f 1 2 x\n", 4, "'x' is not a vertex index"),
        ("f 1 2 3/1/1/1\n", 4, "more than three indices"),
        ("f 1 2 3.5\n", 4, "'3.5' is not a vertex index"),
        ("f 1 2 6148914691236517206\n", 4, "out of range"),
        ("f 1 2 -9223372036854775808\n", 4, "before the start"),
    ];
    for (lines, line, part) in table {
        assert_refused(&[("a.obj", format!("{CORNERS}{lines}").as_bytes())], &format!("a.obj:{line}: "), part);
    }
}

#[test]
fn files_without_faces_are_refused() {
    for text in [
        "",
        "\n\n# nothing\n",
        CORNERS,
        "v 0 0 0\np 1\n",
        "v 0 0 0\nv 1 1 1\nl 1 2\n",
        "v 0 0 0\nv 1 1 1\nf 1\nf 1 2\n",
        "newmtl x\n",
    ] {
        assert_refused(&[("a.obj", text.as_bytes())], "a.obj: no faces; ", "");
    }
    assert_refused(
        &[("a.obj", b"v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 2\n")],
        "a.obj: nothing to see, ",
        "zero area",
    );
}

#[test]
fn points_and_lines_are_left_out_with_one_warning() {
    let loaded = loaded(&format!("{CORNERS}f 1\nf 1 2\np 1\nl 1 2\nf 1 2 3\n"));
    assert_eq!(loaded.description.meshes[0].triangles, [[0, 1, 2]], "one face");
    assert_warned(&loaded, "fewer than three corners, points or lines left out (4 times)");
}

#[test]
fn numbers_in_all_dialects_load() {
    let loaded = loaded("v .8e-1 -.7e+2 5\nv 1 2 3 0.5\nv +1 02. -0.5 1 0 0\nvt 0.25\nvt 0.5 0.75 0\nf 1/1 2/2 3/2\n");
    let mesh = &loaded.description.meshes[0];
    let expected = [Vec3::new(0.08, -70.0, 5.0), Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, -0.5)];
    assert_eq!(mesh.positions, expected, "exponents; weights and colours are left out");
    assert_eq!(mesh.uvs, [Vec2::new(0.25, 0.0), Vec2::new(0.5, 0.75)], "one, two and three texture coordinates");
}

#[test]
fn line_ends_tabs_bom_and_continued_lines_load() {
    for text in [
        "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3",
        "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v\t0 0\t0\n\tv 1 0 0 \n  v 0 1 0\nf\t1 2  3\t\n",
        "v 0 0 0\nv 1 0 \\\n0\nv 0 1 0\nf 1 \\\r\n2 3",
        "v 0 0 0 # origin\nv 1 0 0\nv 0 1 0\nf 1 2 3 # face\n# C:\\folder\\\n#",
    ] {
        let loaded = loaded(text);
        let mesh = &loaded.description.meshes[0];
        assert_eq!((mesh.positions[1], mesh.triangles.as_slice()), (Vec3::X, &[[0, 1, 2]][..]), "{text:?}");
    }
    let text = "v 0 0 0\nv 1 0 \\\n0\nv 0 1 0\nf 1 2 9\n";
    assert_refused(&[("a.obj", text.as_bytes())], "a.obj:5: ", "index 9");
}

#[test]
fn concave_polygons_keep_their_area() {
    let star = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\n";
    assert!((area(&loaded(&format!("{star}f 1 2 3 4 5\n")).description.meshes[0]) - 10.0).abs() < 1e-5, "concave");
    assert!(
        (area(&loaded(&format!("{star}f 3 4 5 1 2\n")).description.meshes[0]) - 10.0).abs() < 1e-5,
        "from another corner"
    );
    assert!(
        (area(&loaded("v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\nf 1 2 3 4\n").description.meshes[0]) - 4.0).abs() < 1e-5,
        "arrow"
    );
    // Two wings of area 1 meet in a point that is no corner; triangles between corners cover at most the hull.
    let bow = loaded("v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nv 0 1 0\nf 1 2 3 4 5\n");
    let found = area(&bow.description.meshes[0]);
    assert!((1.0..=4.0 + 1e-5).contains(&found), "a bow-tie loads: {found}");
}

#[test]
fn polygons_of_many_corners_load_up_to_the_limit() {
    let polygon = |count: usize| {
        let mut text = String::new();
        for i in 0..count {
            let angle = i as f64 / count as f64 * std::f64::consts::TAU;
            text += &format!("v {} {} 0\n", angle.cos(), angle.sin());
        }
        let corners: String = (1..=count).map(|i| format!(" {i}")).collect();
        text + "f" + &corners + "\n"
    };
    let circle = loaded(&polygon(50_000));
    assert!((area(&circle.description.meshes[0]) - std::f32::consts::PI).abs() < 1e-3, "a 50,000-gon is nearly a disk");
    let hundred_thousand = polygon(100_000);
    assert_refused(
        &[("a.obj", hundred_thousand.as_bytes())],
        "a.obj:100001: ",
        "a polygon of 100000 corners, more than the limit of 65536",
    );
    let mut comb: String = (0..5000).map(|i| format!("v {i} {} 0\n", i % 2)).collect();
    comb += "v 5000 9 0\nv -1 9 0\nf";
    comb.extend((1..=5002).map(|i| format!(" {i}")));
    assert_refused(
        &[("a.obj", comb.as_bytes())],
        "a.obj:5003: ",
        "a concave polygon of 5002 corners, more than the limit of 4096",
    );
}

#[test]
fn hostile_polygons_take_bounded_time() {
    // Corners that fall together are the slowest to cut: each of these faces takes some tenths of a second.
    let bit = |i: u32, k: u32| (i.wrapping_mul(2_654_435_761) >> k) & 1;
    let mut text: String = (0..4096).map(|i| format!("v {} {} 0\n", bit(i, 31), bit(i, 27))).collect();
    let corners: String = (1..=4096).map(|i| format!(" {i}")).collect();
    text += &format!("f{corners}\n").repeat(100);
    assert_refused(&[("a.obj", text.as_bytes())], "a.obj:4113: too many large concave polygons; ", "");
}

#[test]
fn what_is_not_text_is_refused() {
    assert_refused(&[("a.obj", &[0; 100])], "a.obj:1: it is not text", "");
    let mut long = vec![b'#'; 100 << 20];
    assert_refused(&[("a.obj", &long)], "a.obj:1: the line is longer than the limit of 16777216 bytes", "");
    long.truncate(1 << 20);
    long.extend_from_slice(b"\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert!(load_files(&[("a.obj", &long)]).is_ok(), "a comment of 1 MB");
    let continued = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3{}\n", " \\\n".repeat(1 << 20));
    assert!(load_files(&[("a.obj", continued.as_bytes())]).is_ok(), "a line in a million parts");
    let face = format!("{CORNERS}f{}\n", " 1".repeat(6 << 20));
    assert_refused(&[("a.obj", face.as_bytes())], "a.obj:4: a polygon of 6291456 corners", "");
}

#[test]
fn normals_and_texture_coordinates_stay_where_they_are_given() {
    let text = format!(
        "{CORNERS}vn 0 0 2\nvn 0 0 0\nvt 0 1\nf 1 2 3\nf 1//1 2//1 3//1\nf 1/1 2/1 3/1\nf 1/1/1 2/1 3//1\nf 1//2 2//1 3//1\n"
    );
    let loaded = loaded(&text);
    let mesh = &loaded.description.meshes[0];
    assert_eq!(mesh.normals[0], Vec3::Z, "unit length");
    let none = [NO_INDEX; 3];
    assert_eq!(
        mesh.normal_indices,
        [none, [0; 3], none, none, none],
        "flat where a corner has none or one of length zero"
    );
    assert_eq!(mesh.uv_indices, [none, none, [0; 3], none, none], "none where a corner has none");
    assert_warned(&loaded, "normals of length zero");
}

#[test]
fn missing_materials_are_grey_with_a_warning() {
    let missing =
        loaded(&format!("mtllib none.mtl\n{CORNERS}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl a\nf 3 2 1\n"));
    assert_eq!(missing.description.materials.len(), 1, "one grey");
    assert_eq!(missing.description.materials[0].diffuse, Vec3::splat(0.5), "grey");
    assert_warned(&missing, "'none.mtl' not found");
    assert_warned(&missing, "'a' is in no library");
    assert_warned(&missing, "'b' is in no library");
    let plain = loaded(&format!("{CORNERS}f 1 2 3\n"));
    assert!(plain.warnings.is_empty(), "a file without materials is no fault: {:?}", plain.warnings);
    assert!(
        plain.description.environment.is_some() && plain.description.camera.is_none(),
        "a sky, and the core frames it"
    );
}

#[test]
fn materials_follow_their_faces() {
    let obj = format!(
        "usemtl red\nmtllib my\\ lib.mtl sub/b.mtl\n{CORNERS}f 1 2 3\nusemtl gr\u{fc}n\nf 1 2 3\nusemtl red\nf 3 2 1\n"
    );
    let latin: Vec<u8> = obj.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin-1")).collect();
    let files: [(&str, &[u8]); 3] = [
        ("a.obj", &latin),
        ("my lib.mtl", b"newmtl red\nKd 1 0 0\nnewmtl blue\nmap_Kd none.png"),
        ("sub/b.mtl", b"newmtl gr\xfcn\nKd 0 1 0\n"),
    ];
    let loaded = load_files(&files).unwrap();
    let description = &loaded.description;
    let colors: Vec<Vec3> =
        description.meshes[0].materials.iter().map(|&m| description.materials[m as usize].diffuse).collect();
    assert_eq!(colors, [Vec3::X, Vec3::Y, Vec3::X], "Latin-1 names, a blank in a name, a library after its use");
    assert!(loaded.warnings.is_empty(), "what no face uses is not looked at: {:?}", loaded.warnings);
}

#[test]
fn libraries_are_found_in_other_folders_and_read_once() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("a")).unwrap();
    std::fs::create_dir_all(folder.path().join("other")).unwrap();
    std::fs::write(folder.path().join("other/x.mtl"), "newmtl m\nKd 1 0 0\n").unwrap();
    let absolute = folder.path().join("other/x.mtl").display().to_string();
    for library in ["../other/x.mtl", "..\\other\\x.mtl", absolute.as_str()] {
        let text = format!("mtllib {library}\n{CORNERS}usemtl m\nf 1 2 3\n");
        std::fs::write(folder.path().join("a/a.obj"), text).unwrap();
        let loaded = scene::load(&folder.path().join("a/a.obj"), &scene::LoadOptions::default()).unwrap();
        assert_eq!(loaded.description.materials[0].diffuse, Vec3::X, "{library}");
    }
    // What another machine wrote as an absolute path is looked for beside; a relative one is not.
    for (library, found) in [("C:\\models\\x.mtl", true), ("/nowhere/x.mtl", true), ("nowhere/x.mtl", false)] {
        let text = format!("mtllib {library}\n{CORNERS}usemtl m\nf 1 2 3\n");
        let loaded = load_files(&[("a.obj", text.as_bytes()), ("x.mtl", b"newmtl m\nKd 1 0 0\n")]).unwrap();
        assert_eq!(loaded.description.materials[0].diffuse == Vec3::X, found, "{library}");
    }
    let library: String = (0..1000).map(|i| format!("newmtl m{i}\nKd 0.5\n")).collect();
    let thousand = format!("{}{CORNERS}usemtl m7\nf 1 2 3\n", "mtllib x.mtl\nmtllib ./x.mtl\n".repeat(1000));
    let loaded = load_files(&[("a.obj", thousand.as_bytes()), ("x.mtl", library.as_bytes())]).unwrap();
    assert_eq!(
        (loaded.description.materials.len(), loaded.warnings.len()),
        (1, 0),
        "one material is used, none is doubled"
    );
    let many: String = (0..1001).map(|i| format!("mtllib {i}.mtl\n")).collect();
    assert_refused(
        &[("a.obj", (many + CORNERS + "f 1 2 3\n").as_bytes())],
        "a.obj:1001: more than 1000 material libraries",
        "",
    );
}

#[test]
fn limits_are_enforced_by_name() {
    let name = "n".repeat(4097);
    assert_refused(
        &[("a.obj", format!("{CORNERS}usemtl {name}\nf 1 2 3\n").as_bytes())],
        "a.obj:4: a name of 4097 bytes, more than the limit of 4096",
        "",
    );
    let many: String = (0..65_536).map(|i| format!("usemtl {i}\n")).collect();
    assert_refused(
        &[("a.obj", (many + CORNERS + "f 1 2 3\n").as_bytes())],
        "a.obj:65536: more than 65536 materials",
        "",
    );
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, part: &str| {
        let error = scene::load(&folder.path().join(name), &scene::LoadOptions::default()).unwrap_err();
        let text = common::text_of(&error, folder.path());
        assert!(text.starts_with(name) && text.contains(part), "{text}");
    };
    std::fs::create_dir(folder.path().join("folder.obj")).unwrap();
    refused("folder.obj", "is not a regular file");
    refused("none.obj", "cannot be read");
    refused("scene.blend", "give a .toml or .obj file");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/zero", folder.path().join("zero.obj")).unwrap();
        refused("zero.obj", "is not a regular file");
        let pipe = folder.path().join("pipe.obj");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success(), "a pipe is made");
        refused("pipe.obj", "is not a regular file");
        // A sparse file of 2 GB and a byte takes no room on the disk.
        std::fs::File::create(folder.path().join("big.obj")).unwrap().set_len((2 << 30) + 1).unwrap();
        refused("big.obj", "has 2147483649 bytes, more than the limit of 2147483648");
    }
}

#[test]
fn extension_may_be_in_capitals() {
    let text = format!("{CORNERS}f 1 2 3\n");
    assert!(load_files(&[("A.OBJ", text.as_bytes())]).is_ok(), "A.OBJ");
}
