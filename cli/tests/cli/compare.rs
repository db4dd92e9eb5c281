//! `compare` and `info` on the study's references, whose figures are known.

use std::fs;
use std::path::Path;

use crate::common::{Run, data, folder, freelux, freelux_words, names};

const CORNELL: &str = "study/cornell/reference.exr";
const GLOSSY: &str = "study/cornell-glossy/reference.exr";

fn compare(folder: &Path, a: &str, b: &str, args: &[&str]) -> Run {
    let (a, b) = (data(a), data(b));
    let mut all = vec!["compare", a.to_str().expect("text"), b.to_str().expect("text")];
    all.extend(args);
    freelux(folder, &all)
}

/// The number after `name` in the table.
fn value(run: &Run, name: &str) -> f64 {
    let line = run.stdout.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("no {name}: {run:?}"));
    let rest = line[name.len()..].split_whitespace().next().expect("a value");
    rest.parse().unwrap_or_else(|_| panic!("{rest} is a number"))
}

#[test]
fn a_picture_is_equal_to_itself() {
    let folder = folder();
    let run = compare(folder.path(), CORNELL, CORNELL, &["--max=relmse=0", "--max=flip=0", "--max=ratio=0"]);
    run.expect_done();
    assert_eq!(value(&run, "relMSE "), 0.0, "{run:?}");
    assert_eq!(value(&run, "FLIP "), 0.0, "{run:?}");
    assert_eq!(value(&run, "ratio of means "), 1.0, "{run:?}");
    // The exposure that tests/data/study/README.md states.
    assert!(run.stdout.contains("exposure 6.7628"), "{run:?}");
}

#[test]
fn a_limit_that_is_passed_gives_exit_code_1() {
    let folder = folder();
    let run = compare(folder.path(), GLOSSY, CORNELL, &["--max", "robust=0.001"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(run.stderr.lines().count() == 1 && run.stderr.contains("robust is above 0.001"), "and it is said: {run:?}");
    assert!(value(&run, "relMSE robust ") > 0.001, "the table is printed all the same: {run:?}");
    compare(folder.path(), GLOSSY, CORNELL, &["--max", "robust=1000"]).expect_done();
}

#[test]
fn the_difference_is_a_picture_of_the_same_size() {
    let folder = folder();
    compare(folder.path(), GLOSSY, CORNELL, &["--diff", "d.png"]).expect_done();
    assert_eq!(names(folder.path()), ["d.png"], "one file");
    let png = image::open(folder.path().join("d.png")).unwrap().into_rgb8();
    assert_eq!(png.dimensions(), (256, 256), "the size of the pictures");
    let red_over_blue = |pixel: &image::Rgb<u8>| i16::from(pixel.0[0]) - i16::from(pixel.0[2]);
    assert!(png.pixels().any(|pixel| red_over_blue(pixel) > 100), "somewhere brighter");
    assert!(png.pixels().any(|pixel| red_over_blue(pixel) < -100), "somewhere darker");
}

#[test]
fn sizes_that_differ_are_refused() {
    let folder = folder();
    compare(folder.path(), CORNELL, "study/atrium-env/env.exr", &["--diff=d.png"]).expect_refused(2, "differ in size");
    assert_eq!(names(folder.path()), [""; 0], "no difference is written");
}

#[test]
fn codes_for_a_display_are_made_linear() {
    let folder = folder();
    let save = |name: &str, code: u8| {
        image::RgbImage::from_pixel(8, 8, image::Rgb([code; 3])).save(folder.path().join(name)).unwrap();
    };
    save("a.png", 188);
    save("b.png", 255);
    let run = freelux(folder.path(), &["compare", "a.png", "b.png"]);
    // Code 188 is a linear 0.5029.
    assert!((value(run.expect_done(), "ratio of means ") - 0.5029).abs() < 1e-4, "{run:?}");
}

#[test]
fn forms_of_the_gallery_are_printed_and_read_back() {
    let folder = folder();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut count = 0;
    for scene in fs::read_dir(scenes).unwrap().map(|entry| entry.unwrap().path()) {
        if scene.extension().is_none_or(|suffix| suffix != "toml") {
            continue;
        }
        let printed =
            freelux(folder.path(), &["info", "--forms", scene.to_str().unwrap()]).expect_done().stdout.clone();
        fs::write(folder.path().join("again.toml"), &printed).unwrap();
        let again = freelux_words(folder.path(), "info --forms again.toml");
        assert_eq!(again.expect_done().stdout, printed, "{}", scene.display());
        count += 1;
    }
    assert!(count >= 6, "all scenes of the gallery, not {count}");
}

#[test]
fn info_tells_of_scenes_and_pictures() {
    let folder = folder();
    let info = |name: &str| freelux(folder.path(), &["info", data(name).to_str().unwrap()]);
    let scene = info("study/cornell/scene.obj");
    for words in ["triangles       36", "2 triangles that shine", "camera"] {
        assert!(scene.expect_done().stdout.contains(words), "{words} in {scene:?}");
    }
    let picture = info(CORNELL);
    for words in ["256 x 256", "channels        B G R", "OpenEXR", "not finite      0"] {
        assert!(picture.expect_done().stdout.contains(words), "{words} in {picture:?}");
    }
    let depth = |_: exr::prelude::Vec2<usize>| (1.0_f32,);
    let channels = exr::prelude::SpecificChannels::build().with_channel("Z").with_pixel_fn(depth);
    let only_depth = exr::prelude::Image::from_channels((3, 2), channels);
    exr::prelude::WritableImage::write(&only_depth).to_file(folder.path().join("z.exr")).unwrap();
    let run = freelux(folder.path(), &["info", "z.exr"]);
    assert!(run.expect_done().stdout.contains("channels        Z"), "a picture without colours: {run:?}");
    freelux(folder.path(), &["compare", "z.exr", "z.exr"]).expect_refused(2, "no channels R, G and B, but Z");
    fs::write(folder.path().join("a.txt"), "not a picture").unwrap();
    freelux(folder.path(), &["info", "a.txt"]).expect_refused(2, "a.txt");
    freelux(folder.path(), &["info", "."]).expect_refused(2, "not a regular file");
}
