//! What `render` writes: pictures, their channels, statistics; the same bytes for any number of threads.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use crate::common::{Run, data, folder, freelux, freelux_words, names};
use exr::prelude::{Compression, FlatImage, FlatSamples, read_all_flat_layers_from_file};

const CORNELL: [&str; 6] = ["--eye", "278,273,-800", "--at=278,273,-799", "--up=0,1,0", "--fov", "39.3"];

/// Renders the Cornell box, 16 x 16, by `path` where `args` name no method.
fn cornell(folder: &Path, args: &[&str]) -> Run {
    let scene = data("study/cornell/scene.obj");
    let mut all = vec!["render", scene.to_str().expect("the name is text"), "--spp=4", "--size=16x16"];
    if !args.contains(&"--method") {
        all.push("--method=path");
    }
    all.extend(CORNELL);
    all.extend(args);
    freelux(folder, &all)
}

fn channel<'a>(image: &'a FlatImage, name: &str) -> &'a [f32] {
    let channels = &image.layer_data[0].channel_data.list;
    let found =
        channels.iter().find(|channel| channel.name.eq(name)).unwrap_or_else(|| panic!("there is no channel {name}"));
    match &found.sample_data {
        FlatSamples::F32(samples) => samples,
        other => panic!("{name} is not of 32 bits: {other:?}"),
    }
}

fn channel_names(image: &FlatImage) -> Vec<String> {
    image.layer_data[0].channel_data.list.iter().map(|channel| channel.name.to_string()).collect()
}

#[test]
fn the_embedded_scene_renders_to_the_default_names() {
    let folder = folder();
    let run = freelux(folder.path(), &["render", "--method=path", "--spp=1", "--size=16x9"]);
    run.expect_done();
    assert_eq!(names(folder.path()), ["freelux.exr", "freelux.png"], "both pictures and nothing else");
    assert_eq!(run.stdout, "", "stdout is for what was asked");
    for words in ["freelux: path\n", "seconds", "rays", "memory", "wrote freelux.exr, freelux.png"] {
        assert!(run.stderr.contains(words), "{words} in the summary: {}", run.stderr);
    }
    let png = image::open(folder.path().join("freelux.png")).unwrap().into_rgb8();
    assert_eq!(png.dimensions(), (16, 9), "the size asked for");
    assert!(png.pixels().any(|pixel| pixel.0.iter().max() > Some(&60)), "there is light");
}

#[test]
fn the_exr_has_the_channels_and_metadata_that_are_promised() {
    let folder = folder();
    cornell(folder.path(), &["--seed=5", "--out=a.exr"]).expect_done();
    let image = read_all_flat_layers_from_file(folder.path().join("a.exr")).unwrap();
    assert_eq!(image.layer_data.len(), 1, "one part");
    assert_eq!(image.layer_data[0].encoding.compression, Compression::ZIP16, "ZIP");
    let mut expected: Vec<String> = ["A", "B", "G", "R", "depth.Z"].map(String::from).to_vec();
    for prefix in ["albedo", "caustic", "direct", "emitted", "indirect", "specular"] {
        expected.extend(["R", "G", "B"].map(|name| format!("{prefix}.{name}")));
    }
    expected.extend(["X", "Y", "Z"].map(|axis| format!("normal.{axis}")));
    expected.sort();
    assert_eq!(channel_names(&image), expected, "channels");

    // The terms sum to the picture bit for bit, in the order of the film.
    for name in ["R", "G", "B"] {
        let term = |term: &str| channel(&image, &format!("{term}.{name}"));
        let terms = ["emitted", "direct", "specular", "caustic", "indirect"].map(term);
        for (pixel, picture) in channel(&image, name).iter().enumerate() {
            let sum = terms.iter().skip(1).fold(terms[0][pixel], |sum, term| sum + term[pixel]);
            assert_eq!(sum.to_bits(), picture.to_bits(), "pixel {pixel} of {name}");
        }
    }
    assert!(channel(&image, "R").iter().any(|red| *red > 0.01), "there is light");
    assert!(channel(&image, "depth.Z").iter().any(|depth| (800.0..1400.0).contains(depth)), "the box is 800 away");

    let attributes = image.attributes.other.iter().chain(&image.layer_data[0].attributes.other);
    let attributes: HashMap<String, String> =
        attributes.map(|(name, value)| (name.to_string(), format!("{value:?}"))).collect();
    assert!(attributes["freelux:command"].contains("--size=16x16"), "the command");
    assert!(attributes["freelux:seed"].contains('5'), "the seed");
    let software = image.layer_data[0].attributes.software_name.as_ref().unwrap().to_string();
    assert_eq!(software, concat!("freelux ", env!("CARGO_PKG_VERSION")), "the version");
    assert!(image.attributes.chromaticities.is_some(), "the primaries");
}

#[test]
fn rungs_are_channels_where_they_are_asked_for() {
    let folder = folder();
    cornell(folder.path(), &["--method", "reproject", "--out=a.exr"]).expect_done();
    cornell(folder.path(), &["--method", "reproject", "--out=b.exr", "--rungs"]).expect_done();
    let [plain, image] =
        ["a.exr", "b.exr"].map(|name| read_all_flat_layers_from_file(folder.path().join(name)).unwrap());
    let mut expected = channel_names(&plain);
    let names = ["interpolated", "reprojected", "gathered", "filled", "unknown", "unchanged", "moved", "bared"];
    let rungs = names.map(|name| format!("rung.{name}"));
    expected.extend(rungs.clone());
    expected.sort();
    assert_eq!(channel_names(&image), expected, "eight more");
    assert_eq!(channel(&image, "indirect.G"), channel(&plain, "indirect.G"), "of the same picture");
    let [interpolated, reprojected, gathered, filled, unknown, parts @ ..] =
        rungs.each_ref().map(|name| channel(&image, name));
    let indirect = channel(&image, "indirect.G");
    for pixel in 0..indirect.len() {
        let sum = interpolated[pixel] + reprojected[pixel] + gathered[pixel];
        assert!(indirect[pixel] == 0.0 || sum > 0.0, "pixel {pixel} has its light from somewhere");
        assert!(sum <= 1.0 + 1e-5, "nothing splits samples here");
        assert!(filled[pixel] + unknown[pixel] <= reprojected[pixel] + 1e-2, "of what was reprojected");
        let sum = parts.iter().map(|part| part[pixel]).sum::<f32>();
        assert!((sum - filled[pixel]).abs() <= 1e-2 * reprojected[pixel], "parts of what was filled");
    }
}

#[test]
fn records_are_points_of_the_scene() {
    let folder = folder();
    cornell(folder.path(), &["--method", "reproject", "--out=b.exr", "--records", "r.ply", "--stats=s.json"])
        .expect_done();
    let text = fs::read_to_string(folder.path().join("r.ply")).expect("it is text");
    let statistics: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("s.json")).unwrap()).expect("it is JSON");
    let (header, body) = text.split_once("end_header\n").expect("a header");
    let points: Vec<Vec<f32>> =
        body.lines().map(|line| line.split(' ').map(|word| word.parse().expect("a number")).collect()).collect();
    let count = |kind: f32| points.iter().filter(|point| point[13] == kind).count() as u64;
    assert!(header.contains(&format!("element vertex {}\n", points.len())), "{header}");
    assert_eq!(Some(count(0.0)), statistics["records"].as_u64(), "of radiance");
    assert_eq!(Some(count(1.0)), statistics["irradiance_records"].as_u64(), "of irradiance");
    assert!(count(1.0) > 0, "there are some");
    for point in &points {
        assert!(point[..3].iter().all(|x| (-1.0..=561.0).contains(x)), "in the box: {point:?}");
        let length = point[3..6].iter().map(|x| x * x).sum::<f32>();
        assert!((length - 1.0).abs() < 1e-4 && point[6] >= 0.0 && point[7..10].iter().all(|x| *x >= 0.0), "{point:?}");
    }
    // What a refused command would have written is not there.
    let run = cornell(folder.path(), &["--out=c.exr", "--records=p.ply"]);
    run.expect_refused(2, "path keeps no records; choose --method reproject or cache-only");
    assert!(!folder.path().join("p.ply").exists() && !folder.path().join("c.exr").exists(), "nothing is written");
}

#[test]
fn a_term_alone_is_the_picture() {
    let folder = folder();
    cornell(folder.path(), &["--out=all.exr"]).expect_done();
    cornell(folder.path(), &["--out=direct.exr", "--term=direct"]).expect_done();
    let all = read_all_flat_layers_from_file(folder.path().join("all.exr")).unwrap();
    let direct = read_all_flat_layers_from_file(folder.path().join("direct.exr")).unwrap();
    assert_eq!(channel_names(&direct), ["A", "B", "G", "R"], "nothing but the term");
    assert_eq!(channel(&direct, "G"), channel(&all, "direct.G"), "the same values");
    assert_ne!(channel(&direct, "G"), channel(&all, "G"), "which are not the whole picture");
}

#[test]
fn the_papers_own_reprojection_has_options() {
    let folder = folder();
    let render = |name: &str, more: &[&str]| {
        // Records that reach far, so that some points reproject.
        let words = ["--method", "reproject", "--quality=0.1", "--set=spacing=0.8", "-o", name];
        cornell(folder.path(), &[&words[..], more].concat()).expect_done();
        let image = read_all_flat_layers_from_file(folder.path().join(name)).unwrap();
        channel(&image, "indirect.G").to_vec()
    };
    let default = render("default.exr", &[]);
    let rectangles = render("rectangles.exr", &["--coverage", "rect"]);
    let both = render("both.exr", &["--coverage", "rect", "--trail", "all"]);
    assert!(default != rectangles && rectangles != both, "each changes something");
    assert_eq!(both, render("set.exr", &["--set=coverage=rect", "--set=trail=all"]), "settings for study");
    let named = render("named.exr", &["--set=trail=all", "--coverage=quad", "--trail=uncovered"]);
    assert_eq!(named, default, "the defaults by name, which come after all --set");
}

#[test]
fn threads_do_not_change_a_byte_and_the_seed_does() {
    let folder = folder();
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    for method in ["path", "gather", "reproject", "cache-only"] {
        let render = |threads: &str, more: &[&str]| {
            let words = ["--quiet", "--quality=0.1", "--method", method, "--threads", threads];
            cornell(folder.path(), &[&words[..], more].concat()).expect_done();
        };
        for threads in ["1", "2", "3"] {
            render(threads, &[&format!("--out={threads}.exr"), &format!("--out={threads}.png")]);
        }
        for suffix in ["exr", "png"] {
            for threads in ["2", "3"] {
                let (one, more) = (read(&format!("1.{suffix}")), read(&format!("{threads}.{suffix}")));
                assert!(one == more, "{method} by one and by {threads} threads, {suffix}");
            }
        }
        render("2", &["--seed=1", "--out=seed.png"]);
        assert!(read("1.png") != read("seed.png"), "another seed, {method}");
    }
}

#[test]
fn statistics_are_written_as_json() {
    let folder = folder();
    let run = cornell(folder.path(), &["--out=a.png", "--stats=a.json", "--quiet", "--threads=2"]);
    assert_eq!(run.expect_done().stderr, "", "quiet");
    let json: serde_json::Value = serde_json::from_slice(&fs::read(folder.path().join("a.json")).unwrap()).unwrap();
    assert!(json["render_seconds"].as_f64().unwrap() > 0.0, "{json}");
    assert_eq!((json["threads"].as_u64(), json["method"].as_str()), (Some(2), Some("path")), "{json}");
    assert_eq!(json["rays"]["camera"], 16 * 16 * 4, "four samples a pixel");

    let run = cornell(folder.path(), &["--out=a.png", "--stats=-", "--quiet"]);
    let json: serde_json::Value = serde_json::from_str(&run.expect_done().stdout).unwrap();
    assert_eq!(json["size"], serde_json::json!([16, 16]), "the same on stdout");
}

#[test]
fn an_error_that_is_asked_for_is_estimated_in_a_channel() {
    let folder = folder();
    let scene = data("study/cornell/scene.toml");
    let scene = scene.to_str().expect("the name is text");
    let args = ["render", scene, "--size=16x16", "--error=0.3", "--out=a.exr", "--stats=a.json", "--quiet"];
    freelux(folder.path(), &args).expect_done();
    let image = read_all_flat_layers_from_file(folder.path().join("a.exr")).unwrap();
    let error = channel(&image, "error.Y");
    let within = error.iter().filter(|&&error| error <= 0.3).count();
    assert!(within as f32 >= 0.95 * error.len() as f32, "{within} of {} pixels", error.len());
    let json: serde_json::Value = serde_json::from_slice(&fs::read(folder.path().join("a.json")).unwrap()).unwrap();
    assert_eq!(json["error"]["is_reached"], true, "{json}");
    assert!(json["error"]["passes"].as_u64() >= Some(4), "{json}");

    // The command must be one that can be given.
    let ball = "[render]\nspp = 4\n[environment]\nradiance = 1\n\
                [[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\n";
    fs::write(folder.path().join("ball.toml"), ball).unwrap();
    let words = "render ball.toml --size=8x8 --error=0.5 --out=b.exr --stats=b.json";
    let run = freelux_words(folder.path(), words);
    let told = &run.expect_done().stderr;
    assert!(told.contains(" passes: within ") && told.contains("% of the pixels, 50.000 % asked"), "{told}");
    let json: serde_json::Value = serde_json::from_slice(&fs::read(folder.path().join("b.json")).unwrap()).unwrap();
    let command = json["command"].as_str().unwrap();
    assert!(command.contains("--error=0.5") && !command.contains("--spp"), "{command}");
}

#[test]
fn exposure_brightens_the_png_alone() {
    let folder = folder();
    let mean = |name: &str| {
        let png = image::open(folder.path().join(name)).unwrap().into_rgb8();
        png.pixels().flat_map(|pixel| pixel.0).map(f64::from).sum::<f64>()
    };
    cornell(folder.path(), &["--exposure=0", "--out=0.png", "--out=0.exr"]).expect_done();
    cornell(folder.path(), &["--exposure=2", "--out=2.png", "--out=2.exr"]).expect_done();
    assert!(mean("2.png") > 1.2 * mean("0.png"), "{} against {}", mean("2.png"), mean("0.png"));
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("0.exr"), read("2.exr"), "the EXR is not exposed");
}

#[cfg(unix)]
#[test]
fn names_of_files_need_not_be_text() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let name = std::ffi::OsStr::from_bytes(b"a\xff.png");
    let scene = data("study/cornell/scene.toml");
    let words = ["render".as_ref(), scene.as_os_str(), "--size=2x2".as_ref(), "--out".as_ref(), name];
    freelux(folder.path(), &words).expect_done();
    assert!(folder.path().join(name).exists(), "{:?}", names(folder.path()));
}

#[test]
fn surroundings_light_the_embedded_scene_too() {
    let folder = folder();
    let env = data("study/atrium-env/env.exr");
    // The room is closed: the camera stands above it and looks up.
    let camera = ["--eye=0,50,0", "--at=0,100,0", "--up=0,0,1"];
    let render = |more: [&str; 2]| {
        let args = ["render", "--method=path", "--spp=1", "--size=8x8", "--env", env.to_str().unwrap()];
        freelux(folder.path(), &[&args[..], &camera, &more].concat()).expect_done();
    };
    render(["--env-scale=1", "--out=a.exr"]);
    render(["--env-scale=0", "--out=b.exr"]);
    let sum = |name: &str| {
        let image = read_all_flat_layers_from_file(folder.path().join(name)).unwrap();
        channel(&image, "B").iter().sum::<f32>()
    };
    assert!(sum("a.exr") > 1.0, "the sky is seen: {}", sum("a.exr"));
    assert_eq!(sum("b.exr"), 0.0, "scaled to nothing it is black");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_and_a_closed_pipe_end_without_a_trace() {
    let folder = folder();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("full.exr")).unwrap();
    let run = cornell(folder.path(), &["--quiet", "--out=a.png", "--out=full.exr"]);
    run.expect_refused(1, "full.exr: cannot be written");
    assert_eq!(names(folder.path()), ["full.exr"], "neither the other picture nor a part of it");

    let mut child = crate::common::command(folder.path())
        .args(["info", data("study/cornell/reference.exr").to_str().unwrap()])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "the closed pipe ends it quietly: {output:?}");

    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let output = crate::common::command(folder.path()).arg("--help").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "the full device is told");
    assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 1, "in one line");
}

#[cfg(unix)]
#[test]
fn an_interruption_while_writing_leaves_neither_picture_nor_rest() {
    use std::time::{Duration, Instant};
    let folder = folder();
    // So many pixels that encoding them takes its time.
    let scene = data("study/cornell/scene.toml");
    let mut child = crate::common::command(folder.path())
        .args(["render", scene.to_str().unwrap(), "--method=path", "--spp=1", "--size=1024x1024", "--out=a.exr"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let is_encoding = |stderr: &mut dyn std::io::Read| {
        // The trial before the work is gone once the first phase is told.
        let (mut told, mut byte) = (Vec::new(), [0]);
        while !told.ends_with(b"freelux: path\n") {
            assert_eq!(stderr.read(&mut byte).unwrap(), 1, "it ends early: {}", String::from_utf8_lossy(&told));
            told.push(byte[0]);
        }
        let start = Instant::now();
        while !names(folder.path()).iter().any(|name| name.starts_with(".freelux-")) {
            assert!(start.elapsed() < Duration::from_secs(120), "no file is begun");
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    is_encoding(child.stderr.as_mut().unwrap());
    let kill = std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(kill.success(), "the signal is sent");
    let mut told = String::new();
    std::io::Read::read_to_string(child.stderr.as_mut().unwrap(), &mut told).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(128 + 15), "as shells have it");
    assert!(told.ends_with("freelux: interrupted before it was written: a.exr\n"), "{told}");
    assert_eq!(names(folder.path()), [""; 0], "nothing is left");
}
