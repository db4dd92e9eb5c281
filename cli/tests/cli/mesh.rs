//! `freelux mesh`: free forms as OBJ files, which the program itself can read again.

use std::fs;

use crate::common::{folder, freelux_words, names};

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
fn what_has_no_mesh_is_refused() {
    let folder = folder();
    let endless = "[[form]]\nname = \"rod\"\nquadric.cylinder = { point = [0, 0, 0], axis = [0, 1, 0], radius = 1 }\n";
    fs::write(folder.path().join("a.toml"), endless).unwrap();
    fs::write(folder.path().join("b.toml"), BALLS).unwrap();
    for (words, why) in [
        ("mesh a.toml --cell 0.1 --out a.obj", "\"rod\": the form has no bounds; clip it"),
        ("mesh b.toml --cell 0 --out a.obj", "the cell must be positive"),
        ("mesh b.toml --cell 1e-9 --out a.obj", "take a larger cell"),
        ("mesh b.toml --cell 0.1 --out a.stl", ".obj"),
        ("mesh c.toml --cell 0.1 --out a.obj", "c.toml"),
    ] {
        freelux_words(folder.path(), words).expect_refused(2, why);
    }
    assert_eq!(names(folder.path()), ["a.toml", "b.toml"], "nothing was written");
}
