//! The commands of the README do what it says.

use std::fs;

use crate::common::{data, folder, freelux, names};

#[test]
fn the_commands_of_the_readme_run() {
    let folder = folder();
    for name in ["scene.obj", "scene.mtl", "scene.toml"] {
        fs::copy(data("study/cornell").join(name), folder.path().join(name)).unwrap();
    }
    let commands = include_str!("../../README.md").lines().filter_map(|line| line.strip_prefix("freelux "));
    let mut count = 0;
    for line in commands.filter(|line| !line.is_empty()) {
        // Small and quick; the rest is as the README has it.
        let mut words: Vec<&str> = line.split(' ').map(|word| if word == "256x256" { "8x8" } else { word }).collect();
        if words == ["render"] {
            words.extend(["--size", "16x9"]);
        }
        if words[0] == "render" {
            words.extend(["--quality", "0.05"]);
        }
        let run = freelux(folder.path(), &words);
        // At this size the pictures may be farther apart than the limit.
        let allowed: &[i32] = if words[0] == "compare" { &[0, 1] } else { &[0] };
        assert!(run.code.is_some_and(|code| allowed.contains(&code)), "freelux {line}: {run:?}");
        count += 1;
    }
    assert!(count >= 7, "only {count} commands are in the README");
    let pictures = ["box.exr", "box.png", "charts", "difference.png", "freelux.exr", "freelux.png", "reference.exr"];
    assert_eq!(
        names(folder.path()),
        [&pictures[..], &["scene.mtl", "scene.obj", "scene.toml"]].concat(),
        "the files that it names"
    );
}
