//! `freelux mesh`: free forms as OBJ files, which the program itself can read again.

use std::fs;

use crate::common::{folder, freelux, freelux_words, names};

const BALLS: &str = "
[[form]]
name = \"bitten ball\"
difference = [
    { quadric.sphere = { center = [0, 0, 0], radius = 1 } },
    { quadric.sphere = { center = [1, 0, 0], radius = 0.5 } },
]
[[form]]
quadric.sphere = { center = [3, 0, 0], radius = 0.5 }
";

#[test]
fn forms_become_a_file_that_is_read_again() {
    let folder = folder();
    fs::write(folder.path().join("a.toml"), BALLS).unwrap();
    freelux_words(folder.path(), "mesh a.toml --cell 0.1 --out a.obj").expect_done();
    assert_eq!(names(folder.path()), ["a.obj", "a.toml"], "one file");
    let obj = fs::read_to_string(folder.path().join("a.obj")).unwrap();
    let objects: Vec<&str> = obj.lines().filter(|line| line.starts_with("o ")).collect();
    assert_eq!(objects, ["o bitten_ball", "o form_1"], "an object for each form");
    let triangles = obj.lines().filter(|line| line.starts_with("f ")).count();
    let info = freelux_words(folder.path(), "info a.obj");
    let told = info.expect_done().stdout.lines().find(|line| line.starts_with("triangles")).map(str::to_owned);
    assert_eq!(told, Some(format!("{:<14}  {triangles}", "triangles")), "{info:?}");
}

#[test]
fn files_that_a_scene_names_are_not_replaced() {
    let folder = folder();
    let square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    fs::write(folder.path().join("m.obj"), square).unwrap();
    fs::write(folder.path().join("a.toml"), format!("{BALLS}\n[[mesh]]\nfile = \"m.obj\"\n")).unwrap();
    for words in ["mesh a.toml --cell 0.1 --out m.obj", "render a.toml --size 2x2 --out b.png --stats m.obj"] {
        freelux_words(folder.path(), words).expect_refused(2, "m.obj: would replace what is read");
        assert_eq!(names(folder.path()), ["a.toml", "m.obj"], "nothing is written");
        assert_eq!(fs::read_to_string(folder.path().join("m.obj")).unwrap(), square, "nor changed");
    }
}

#[test]
fn what_has_no_mesh_is_refused() {
    let folder = folder();
    let endless = "[[form]]\nname = \"rod\"\nquadric.cylinder = { point = [0, 0, 0], axis = [0, 1, 0], radius = 1 }\n";
    fs::write(folder.path().join("a.toml"), endless).unwrap();
    fs::write(folder.path().join("b.toml"), BALLS).unwrap();
    fs::write(
        folder.path().join("many.toml"),
        format!("{BALLS}repeat = {{ count = [100, 10, 100], step = [2, 2, 2] }}\n"),
    )
    .unwrap();
    for (words, why) in [
        ("mesh a.toml --cell 0.1 --out a.obj", "no form has bounds; clip one"),
        ("mesh many.toml --cell 0.02 --out a.obj", "take a larger cell, or --once"),
        ("mesh a.toml --cell 0.1 --form rod --out a.obj", "\"rod\": the form has no bounds; clip it"),
        ("mesh b.toml --cell 0.1 --form rod --out a.obj", "no form \"rod\"; give a name, or a number below 2"),
        ("mesh b.toml --cell 10 --form 1 --out a.obj", "no corner of a cell is inside"),
        ("mesh b.toml --cell 0 --out a.obj", "it must be above 0"),
        ("mesh none.toml --cell -1 --out a.obj", "it must be above 0"),
        ("mesh b.toml --cell 1e-9 --out a.obj", "take a larger cell"),
        ("mesh b.toml --cell 0.1 --out a.stl", ".obj"),
        ("mesh c.toml --cell 0.1 --out a.obj", "c.toml"),
    ] {
        freelux_words(folder.path(), words).expect_refused(2, why);
    }
    assert_eq!(names(folder.path()), ["a.toml", "b.toml", "many.toml"], "nothing was written");
}

#[test]
fn forms_are_chosen_by_name_or_number() {
    let folder = folder();
    let endless = "[[form]]\nquadric.half_space = { point = [0, -1, 0], normal = [0, 1, 0] }\n";
    fs::write(
        folder.path().join("a.toml"),
        format!("{BALLS}repeat = {{ count = [3, 1, 1], step = [2, 0, 0] }}\n{endless}"),
    )
    .unwrap();
    let objects = |words: &[&str]| {
        freelux(folder.path(), &[&["mesh", "a.toml", "--cell", "0.1", "--out", "a.obj"], words].concat()).expect_done();
        let obj = fs::read_to_string(folder.path().join("a.obj")).unwrap();
        obj.lines().filter_map(|line| line.strip_prefix("o ").map(str::to_owned)).collect::<Vec<_>>()
    };
    assert_eq!(objects(&[]), ["bitten_ball", "form_1_0", "form_1_1", "form_1_2"], "all that have bounds");
    assert_eq!(objects(&["--once"]), ["bitten_ball", "form_1"], "without copies");
    assert_eq!(objects(&["--form", "1", "--once"]), ["form_1"], "by number");
    assert_eq!(objects(&["--form", "bitten ball"]), ["bitten_ball"], "by name");
}

#[test]
fn forms_with_pictures_have_texture_coordinates() {
    let folder = folder();
    let material = "[[material]]\nname = \"painted\"\ndiffuse_texture = \"a.png\"\n";
    image::RgbImage::new(2, 2).save(folder.path().join("a.png")).unwrap();
    let ball = "[[form]]\nmaterial = \"painted\"\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\n";
    let projected = format!("{ball}projection.box = {{ size = 1 }}\n");
    fs::write(folder.path().join("a.toml"), format!("{material}{ball}{projected}")).unwrap();
    freelux_words(folder.path(), "mesh a.toml --cell 0.2 --out a.obj").expect_done();
    let obj = fs::read_to_string(folder.path().join("a.obj")).unwrap();
    let uvs = obj.lines().filter(|line| line.starts_with("vt ")).count();
    let corners = obj.lines().filter_map(|line| line.strip_prefix("f ")).flat_map(|line| line.split(' '));
    let used: Vec<usize> = corners.map(|corner| corner.split('/').nth(1).unwrap().parse().unwrap()).collect();
    assert_eq!(used.iter().max(), Some(&uvs), "both forms number theirs in one row");
    assert!((1..=uvs).all(|uv| used.contains(&uv)), "and use them all");
}
