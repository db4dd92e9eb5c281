//! Hostile files: each is loaded or refused in one line, within ten seconds and 512 MB, and what is refused leaves
//! nothing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Run, data, folder, names};

/// 512 MB over the start, and what the program itself and its thread stacks take of address space at the start.
const LIMIT_KIB: u32 = (512 + 128) * 1024;
const LONGEST: Duration = Duration::from_secs(10);

/// Runs the binary with a limit on its address space and its time.
fn limited(folder: &Path, args: &[&str]) -> Run {
    let script = format!("ulimit -v {LIMIT_KIB} && exec \"$0\" \"$@\"");
    let mut child = Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_freelux")])
        .args(args)
        .current_dir(folder)
        // One arena: the others reserve address space that is never used.
        .env("MALLOC_ARENA_MAX", "1")
        .stdin(Stdio::null())
        .stdout(fs::File::create(folder.join("stdout")).expect("a file for stdout"))
        .stderr(fs::File::create(folder.join("stderr")).expect("a file for stderr"))
        .spawn()
        .expect("the binary starts");
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("the child can be waited for") {
            break status;
        }
        if start.elapsed() > LONGEST {
            child.kill().expect("the child can be ended");
            panic!("{args:?} takes longer than {LONGEST:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let take = |name: &str| {
        let text = fs::read(folder.join(name)).expect("the stream was kept");
        fs::remove_file(folder.join(name)).expect("the file is ours");
        String::from_utf8_lossy(&text).into_owned()
    };
    Run { code: status.code(), stdout: take("stdout"), stderr: take("stderr") }
}

/// Checks the rule for every file; returns how many were loaded.
fn check_all(files: &[PathBuf], args: impl Fn(&str) -> Vec<String>) -> usize {
    let mut loaded = 0;
    for file in files {
        let folder = folder();
        let args = args(file.to_str().expect("names are text"));
        let run = limited(folder.path(), &args.iter().map(String::as_str).collect::<Vec<_>>());
        let told = format!("{args:?} gives {run:?}");
        assert!(!run.stderr.contains("panicked"), "a panic: {told}");
        match run.code {
            Some(0) => loaded += 1,
            Some(2) => {
                run.expect_refused(2, "");
                assert_eq!(names(folder.path()), [""; 0], "something is left behind: {told}");
            }
            _ => panic!("neither loaded nor refused: {told}"),
        }
    }
    loaded
}

/// The files of a folder of the test data whose names pass, sorted.
fn files(folder: &str, wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries =
        fs::read_dir(data(folder)).expect("the folder can be read").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| wanted(&path.file_name().expect("a name").to_string_lossy())).collect();
    files.sort();
    files
}

fn render(scene: &str) -> Vec<String> {
    render_by("path", scene)
}

fn render_by(method: &str, scene: &str) -> Vec<String> {
    let words =
        ["render", scene, "--method", method, "--quality=0.1", "--spp=1", "--size=4x4", "--threads=2", "--quiet"];
    words.map(String::from).to_vec()
}

#[test]
fn odd_meshes_are_rendered_or_refused() {
    let is_mesh = |name: &str| name.ends_with(".obj");
    let mut meshes = files("odd-obj/tinyobjloader", is_mesh);
    meshes.extend(files("odd-obj/tobj", is_mesh));
    // A find of a fuzzer without a suffix.
    let named = folder();
    meshes.push(named.path().join("fuzz.obj"));
    fs::copy(data("odd-obj/tinyobjloader/fuzz-4877060179886080"), &meshes[meshes.len() - 1]).unwrap();
    assert!(meshes.len() >= 38, "{} meshes", meshes.len());
    let loaded = check_all(&meshes, render);
    assert!(loaded >= 22, "most of them are merely odd, but only {loaded} load");
    assert_eq!(check_all(&meshes, |mesh| render_by("reproject", mesh)), loaded, "the method does not matter");
    assert_eq!(check_all(&meshes, |mesh| vec!["info".into(), mesh.into()]), loaded, "info agrees with render");
}

#[test]
fn damaged_pictures_are_read_or_refused() {
    let pictures = files("damaged-exr", |name| !name.ends_with(".txt"));
    assert!(pictures.len() >= 34, "{} pictures", pictures.len());
    let scene = data("study/cornell/scene.obj");
    let scene = scene.to_str().unwrap();
    check_all(&pictures, |picture| [render(scene), vec!["--env".into(), picture.into()]].concat());
    check_all(&pictures, |picture| vec!["info".into(), picture.into()]);
    check_all(&pictures, |picture| vec!["compare".into(), picture.into(), picture.into(), "--diff=d.png".into()]);
}

#[test]
fn files_that_are_no_files_are_refused() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("folder.obj")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", path("zero.obj")).unwrap();
    std::os::unix::fs::symlink("loop.toml", path("loop.toml")).unwrap();
    assert!(Command::new("mkfifo").arg(path("pipe.exr")).status().unwrap().success(), "a pipe can be made");
    fs::write(path("empty.obj"), "").unwrap();
    fs::write(path("empty.toml"), "").unwrap();
    fs::write(path("nul.obj"), vec![0; 1 << 20]).unwrap();
    fs::write(path("line.obj"), vec![b'f'; 40 << 20]).unwrap();
    fs::write(path("deep.toml"), format!("form = {}{}", "[".repeat(1_000_000), "]".repeat(1_000_000))).unwrap();
    let all = [
        "folder.obj",
        "zero.obj",
        "loop.toml",
        "pipe.exr",
        "empty.obj",
        "empty.toml",
        "nul.obj",
        "line.obj",
        "deep.toml",
    ]
    .map(path);
    assert_eq!(check_all(&all, |file| vec!["info".into(), file.into()]), 0, "all are refused by info");
    assert_eq!(check_all(&all, render), 0, "all are refused by render");
    assert_eq!(check_all(&all[3..4], |file| vec!["compare".into(), file.into(), file.into()]), 0, "and by compare");
}

#[test]
fn bombs_are_refused_before_they_take_memory() {
    let folder = folder();
    // 10^5 x 10^5 pixels in a header, and nothing behind it.
    let hdr = folder.path().join("bomb.hdr");
    fs::write(&hdr, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n").unwrap();
    let png = folder.path().join("bomb.png");
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    bytes.extend([0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff, 8, 2, 0, 0, 0]);
    bytes.extend([0xa6, 0xef, 0x2a, 0x37]);
    fs::write(&png, bytes).unwrap();
    let all = [hdr, png];
    assert_eq!(check_all(&all, |file| vec!["info".into(), file.into()]), 0, "info");
    assert_eq!(check_all(&all, |file| vec!["compare".into(), file.into(), file.into()]), 0, "compare");
    assert_eq!(
        check_all(&all, |file| vec!["render".into(), "--env".into(), file.into(), "--size=2x2".into()]),
        0,
        "render"
    );
}
