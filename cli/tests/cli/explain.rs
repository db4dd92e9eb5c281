//! `explain` tells of a pixel what `render` makes of it.

use crate::common::{Run, data, folder, freelux};
use exr::prelude::{FlatSamples, read_all_flat_layers_from_file};

/// Explains a pixel of the Cornell box, 32 x 32.
fn explain(x: u32, y: u32, more: &[&str]) -> Run {
    let scene = data("study/cornell/scene.toml");
    let (x, y) = (x.to_string(), y.to_string());
    let args = ["explain", scene.to_str().expect("text"), &x, &y, "--size=32x32", "--quality=0.1", "--quiet"];
    freelux(folder().path(), &[&args[..], more].concat())
}

/// The green of a term, or of what paths find.
fn green(run: &Run, term: &str) -> f32 {
    let line = run.stdout.lines().find(|line| line.starts_with(term)).unwrap_or_else(|| panic!("no {term}: {run:?}"));
    line.split_whitespace().nth(2).expect("three numbers").parse().expect("a number")
}

#[test]
fn terms_are_those_of_the_picture_and_the_surface_is_named() {
    let run = explain(10, 28, &[]);
    for words in [
        "pixel           10, 28 of 32 x 32, reproject at quality 0.1",
        "surface 0",
        "material        white",
        "incident",
        "reach",
    ] {
        assert!(run.expect_done().stdout.contains(words), "{words} in {run:?}");
    }
    assert!(["interpolated", "reprojected", "gathered"].iter().any(|how| run.stdout.contains(how)), "one way: {run:?}");

    let (sum, paths) = (green(&run, "sum"), green(&run, "paths"));
    assert!((sum / paths - 1.0).abs() < 0.1, "paths find about the same: {run:?}");
    let difference = format!("the picture differs by {}", if sum > paths { '+' } else { '-' });
    assert!(run.stdout.contains(&difference), "white and lit by a white lamp, all of it alike: {run:?}");
    assert!(run.stdout.contains("% is exceeded by one such pixel of 20"), "the error is estimated: {run:?}");

    let folder = folder();
    let scene = data("study/cornell/scene.toml");
    let args = ["render", scene.to_str().unwrap(), "--size=32x32", "--quality=0.1", "--quiet", "--out=a.exr"];
    freelux(folder.path(), &args).expect_done();
    let image = read_all_flat_layers_from_file(folder.path().join("a.exr")).unwrap();
    for term in ["direct", "indirect"] {
        let name = format!("{term}.G");
        let channel =
            image.layer_data[0].channel_data.list.iter().find(|channel| channel.name.eq(name.as_str())).unwrap();
        let FlatSamples::F32(samples) = &channel.sample_data else { panic!("32 bits") };
        let rendered = samples[28 * 32 + 10];
        // Five digits are printed.
        assert!((green(&run, term) / rendered - 1.0).abs() < 1e-4, "{term}: {rendered} in {run:?}");
    }
}

#[test]
fn pixels_outside_are_refused_and_the_path_tracer_has_no_surfaces() {
    explain(32, 0, &[]).expect_refused(2, "the picture has 32 x 32");
    let run = explain(16, 28, &["--method=path", "--spp=4"]);
    assert!(!run.expect_done().stdout.contains("surface"), "terms alone: {run:?}");
    assert!(green(&run, "sum") > 0.0, "{run:?}");
}
