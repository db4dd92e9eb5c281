//! `chart` from end to end, on scenes so small that its figures mean nothing: what it writes, keeps and refuses.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use crate::common::{Run, data, folder, freelux, freelux_words, names};

/// Copies a study scene without its reference into a folder of its own.
fn scene(folder: &Path, name: &str) {
    let target = folder.join(name);
    fs::create_dir(&target).expect("a folder of its own");
    for file in ["scene.obj", "scene.mtl", "scene.toml"] {
        fs::copy(data("study").join("cornell").join(file), target.join(file)).expect("a copy");
    }
}

/// The rows of a CSV, by the names of the columns.
fn rows(path: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).expect("a CSV");
    reader.deserialize().collect::<Result<_, _>>().expect("rows as long as the head")
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} is {:?}", row[column]))
}

/// Charts two scenes at 16 x 16.
fn chart(folder: &Path, more: &[&str]) -> Run {
    let args = "chart one/scene.toml two/scene.toml --methods path,gather,reproject+verify=0 --qualities 0.05,0.02 --size 16x16 \
                --reference-spp 64 --threads 2 --out charts";
    freelux(folder, &[&args.split_whitespace().collect::<Vec<_>>()[..], more].concat())
}

#[test]
fn a_chart_has_a_row_a_picture_a_line_a_method_and_a_table_a_scene() {
    let folder = folder();
    scene(folder.path(), "one");
    scene(folder.path(), "two");
    let run = chart(folder.path(), &["--repeat=2"]);
    run.expect_done();
    let charts = folder.path().join("charts");
    let mut expected = vec!["chart.csv".to_owned(), "chart.md".to_owned()];
    for name in ["one", "two"] {
        expected.extend(["16x16.64spp.exr", "16x16.64spp.variance.exr", "svg"].map(|end| format!("{name}.{end}")));
    }
    assert_eq!(names(&charts), expected, "the files of both scenes");

    let rows = rows(&charts.join("chart.csv"));
    assert_eq!(rows.len(), 2 * 3 * 2 * 2, "scenes, methods, qualities, repetitions");
    for row in &rows {
        for column in
            ["seconds", "relmse", "robust", "reference_relmse", "reference_robust", "flip", "rays", "memory_bytes"]
        {
            assert!(number(row, column) > 0.0, "{column} of {row:?}");
        }
        for column in ["load_seconds", "build_seconds"] {
            assert!(number(row, column) >= 0.0, "{column} of {row:?}");
        }
        assert_eq!((number(row, "width"), number(row, "threads")), (16.0, 2.0), "{row:?}");
        // The noise of few samples: means are within a third even here.
        assert!((number(row, "ratio_of_means") - 1.0).abs() < 0.3, "{row:?}");
        assert!(row["version"].contains(env!("CARGO_PKG_VERSION")) && !row["cpu"].is_empty(), "{row:?}");
        let phases: f64 =
            row["phases"].split(';').map(|phase| phase.split_once('=').unwrap().1.parse::<f64>().unwrap()).sum();
        assert!(phases <= number(row, "seconds") * 1.001, "phases are parts of the whole: {row:?}");
    }
    let methods: Vec<&str> = rows.iter().take(3).map(|row| row["method"].as_str()).collect();
    assert_eq!(methods, ["path", "gather", "reproject+verify=0"], "methods take turns");
    assert_eq!((rows[0]["quality"].as_str(), rows[11]["quality"].as_str()), ("0.02", "0.05"), "qualities rise");
    assert_ne!(rows[0]["relmse"], rows[3]["relmse"], "repetitions have seeds of their own");
    let records = |number: usize| rows[number]["records"].parse::<u64>().unwrap();
    assert!(records(0) == 0 && records(2) > 0, "only reprojection has records");

    let text = fs::read_to_string(charts.join("one.svg")).unwrap();
    let svg = roxmltree::Document::parse(&text).expect("well-formed XML");
    assert_eq!(svg.root_element().tag_name().namespace(), Some("http://www.w3.org/2000/svg"), "an SVG by itself");
    let count = |name: &str| svg.descendants().filter(|node| node.has_tag_name(name)).count();
    assert_eq!(count("polyline"), 2 * 3, "plain and robust for each method");
    let words: Vec<&str> =
        svg.descendants().filter(|node| node.has_tag_name("text")).filter_map(|node| node.text()).collect();
    for word in ["one", "path", "gather", "reproject+verify=0", "seconds for the whole rendering"] {
        assert!(words.contains(&word), "{word} among {words:?}");
    }
    for line in svg.descendants().filter(|node| node.has_tag_name("polyline")) {
        let points = line.attribute("points").unwrap().split(' ').map(|point| point.split_once(',').unwrap());
        let inside = points.filter(|(x, y)| {
            (0.0..860.0).contains(&x.parse::<f64>().unwrap()) && (0.0..500.0).contains(&y.parse::<f64>().unwrap())
        });
        assert_eq!(inside.count(), 2, "both qualities within the picture: {line:?}");
    }

    let markdown = fs::read_to_string(charts.join("chart.md")).unwrap();
    assert_eq!(run.stdout, markdown, "stdout has the tables too");
    for words in ["## one\n", "## two\n", "![Error over time in one](one.svg)", "| method | 1e-2 | 1e-3 | 3e-4 |"] {
        assert!(markdown.contains(words), "{words} in\n{markdown}");
    }
    assert_eq!(markdown.matches("| reproject+verify=0 | 0.05 |").count(), 2, "each point of each scene once");
}

#[test]
fn a_reference_is_made_once_and_slow_methods_are_not_asked_on() {
    let folder = folder();
    scene(folder.path(), "one");
    let words = "chart one/scene.toml --methods path --qualities 0.02,0.05 --size 8x8 --reference-spp 16 --max-seconds 0 --out a";
    let run = freelux_words(folder.path(), words);
    assert!(run.expect_done().stderr.contains("rendering the reference"), "{run:?}");
    assert!(run.stderr.contains("one path at quality 0.05: left out as too slow"), "{run:?}");
    assert_eq!(rows(&folder.path().join("a/chart.csv")).len(), 1, "the lowest quality alone");
    let first = fs::read(folder.path().join("a/one.8x8.16spp.exr")).unwrap();
    let again = freelux_words(folder.path(), words);
    assert!(!again.expect_done().stderr.contains("rendering the reference"), "kept: {again:?}");
    assert_eq!(fs::read(folder.path().join("a/one.8x8.16spp.exr")).unwrap(), first, "as it was");
}

#[test]
fn the_reference_beside_a_scene_counts_with_the_noise_that_its_readme_states() {
    let folder = folder();
    for (scene, own) in [("cornell", 1.3359e-4), ("cornell-glossy", 3.8079e-4), ("atrium-env", 7.4767e-4)] {
        let path = data("study").join(scene).join("scene.toml");
        let row = |size: &str| {
            let args =
                ["chart", path.to_str().unwrap(), "--methods=path", "--qualities=0.004", "--out=a", "--size", size];
            freelux(folder.path(), &args).expect_done();
            rows(&folder.path().join("a/chart.csv")).remove(0)
        };
        let whole = row("256x256");
        assert!((number(&whole, "reference_relmse") / own - 1.0).abs() < 1e-4, "as the README of the study: {whole:?}");
        assert_eq!(whole["scene"], scene, "named after its folder");
        // Blocks of four pixels have a quarter of the variance; the exposure moves a little.
        let half = number(&row("128x128"), "reference_relmse");
        assert!(half < own / 2.0 && half > own / 8.0, "{half} of {own}");
    }
}

#[test]
fn rows_of_other_programs_are_drawn_and_nothing_is_rendered_for_them() {
    let folder = folder();
    let csv = "scene,method,quality,seconds,relmse,robust,reference_relmse\n\
               hall,path,1,1,1e-2,1e-2,1e-4\nhall,path,4,4,2.5e-3,2.5e-3,1e-4\nhall,other <1>,16,0.5,5e-4,5e-4,1e-4\n";
    fs::write(folder.path().join("peers.csv"), csv).unwrap();
    let run = freelux_words(folder.path(), "chart --add peers.csv --out a");
    assert_eq!(run.expect_done().stderr, "", "nothing is rendered: {run:?}");
    assert_eq!(names(&folder.path().join("a")), ["chart.csv", "chart.md", "hall.svg"], "a chart of what was added");
    let svg = fs::read_to_string(folder.path().join("a/hall.svg")).unwrap();
    roxmltree::Document::parse(&svg).expect("well-formed in spite of the name");
    assert!(
        run.stdout.contains("| other <1> | < 0.500 s | < 0.500 s (> 20.0x) | not reached (5.0e-4) |"),
        "{}",
        run.stdout
    );
    // What is written can be added again, and changes nothing.
    freelux_words(folder.path(), "chart --add a/chart.csv --out b").expect_done();
    assert_eq!(fs::read(folder.path().join("b/hall.svg")).unwrap(), svg.into_bytes(), "the same chart");
}

#[test]
fn wrong_charts_are_refused_in_one_line() {
    let folder = folder();
    scene(folder.path(), "one");
    fs::write(folder.path().join("bad.csv"), "scene,method\na,b\n").unwrap();
    for (words, named) in [
        ("chart --out a", "SCENE"),
        ("chart one/scene.toml", "--out"),
        ("chart one/scene.toml --out a --methods magic", "magic"),
        ("chart one/scene.toml --out a --methods path,path", "path stands there twice"),
        ("chart one/scene.toml --out a --methods path+speed=2", "--methods"),
        ("chart one/scene.toml --out a --qualities 0", "--qualities: quality 0"),
        ("chart one/scene.toml --out a --size 0x1", "size 0x1"),
        ("chart one/scene.toml --out a --repeat 0", "--repeat"),
        ("chart one/scene.toml two.toml --out a --reference r.exr", "--reference"),
        ("chart --out a --add bad.csv", "bad.csv"),
    ] {
        freelux_words(folder.path(), words).expect_refused(2, named);
        assert_eq!(names(folder.path()), ["bad.csv", "one"], "`{words}` leaves nothing behind");
    }
    // Both charts would be room-1.svg.
    scene(folder.path(), "room.1");
    scene(folder.path(), "room-1");
    for (words, named) in [
        ("chart none.toml --out a", "none.toml"),
        ("chart room.1/scene.toml room-1/scene.toml --out a --size 4x4", "rename one of them"),
        (
            "chart one/scene.toml one/scene.toml --out a --size 4x4 --qualities 0.004 --methods path --reference-spp 16",
            "rename it",
        ),
        ("chart one/scene.toml --out a --reference none.exr", "none.exr"),
    ] {
        let run = freelux_words(folder.path(), words);
        assert_eq!(run.code, Some(2), "{words}: {run:?}");
        assert!(run.stderr.lines().last().unwrap().contains(named), "{words}: {run:?}");
    }
    let reference = data("study/cornell/reference.exr");
    let args = ["chart", "one/scene.toml", "--out=a", "--size=100x100", "--reference", reference.to_str().unwrap()];
    freelux(folder.path(), &args).expect_refused(2, "are not blocks of 100 x 100");

    // All is looked at before a picture is made: nothing is told but what is wrong.
    fs::write(folder.path().join("room-1/reference.exr"), "no picture").unwrap();
    fs::create_dir_all(folder.path().join("taken/one.svg")).unwrap();
    let long = format!("{}.toml", "l".repeat(248));
    for (name, copy) in [("scene.toml", long.as_str()), ("scene.obj", "scene.obj"), ("scene.mtl", "scene.mtl")] {
        fs::copy(folder.path().join("one").join(name), folder.path().join(copy)).unwrap();
    }
    for (words, named) in [
        ("chart one/scene.toml room-1/scene.toml --out b --size 4x4", "room-1/reference.exr"),
        ("chart one/scene.toml --out taken --size 4x4", "one.svg: is a folder"),
        (&format!("chart {long} --out b --size 4x4"), "cannot be written there"),
    ] {
        freelux_words(folder.path(), words).expect_refused(2, named);
    }
}
