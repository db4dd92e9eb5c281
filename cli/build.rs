//! Tells the program which compiler and commit it was made of: records of measurements name both.

use std::path::Path;
use std::process::Command;

fn main() {
    let compiler = std::env::var_os("RUSTC").and_then(|rustc| output(Command::new(rustc).arg("--version")));
    let commit = output(Command::new("git").args(["describe", "--always", "--dirty", "--abbrev=10", "--exclude=*"]));
    println!("cargo:rustc-env=FREELUX_COMPILER={}", compiler.as_deref().unwrap_or("unknown compiler"));
    println!("cargo:rustc-env=FREELUX_COMMIT={}", commit.as_deref().unwrap_or("unknown commit"));

    println!("cargo:rerun-if-changed=build.rs");
    // The index changes with each commit and checkout; the sources of the workspace make a commit dirty.
    let index = output(Command::new("git").args(["rev-parse", "--git-path", "index"]));
    let sources = ["hemimap", "freeform", "radcache", "reproject", "scene", "integrator", "cli"];
    for path in index.into_iter().chain(sources.map(|name| format!("../{name}/src"))) {
        // A path that is not there would have this run each time.
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
}

/// What a command prints, in one line; `None` where it cannot run or fails.
fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.lines().next()?.trim().to_owned()).filter(|line| !line.is_empty())
}
