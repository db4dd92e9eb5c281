//! Arguments: help, and that all that is wrong is refused in one line before anything is loaded or written.

use std::fs;

use crate::common::{data, folder, freelux, freelux_words, names};

#[test]
fn help_and_version_go_to_stdout() {
    let folder = folder();
    for (words, expected) in [
        ("--help", "Usage: freelux"),
        ("render --help", "--quality <Q>"),
        ("compare --help", "--diff <FILE.png>"),
        ("info --help", "SCENE|IMAGE"),
        ("chart --help", "--methods <METHOD,...>"),
        ("explain --help", "<X>"),
        ("--version", concat!("freelux ", env!("CARGO_PKG_VERSION"))),
    ] {
        let run = freelux_words(folder.path(), words);
        assert!(run.expect_done().stdout.contains(expected), "{words}: {run:?}");
        assert_eq!(run.stderr, "", "nothing on stderr for {words}");
    }
}

#[test]
fn wrong_arguments_are_refused_in_one_line() {
    let folder = folder();
    let table = [
        ("polish", "polish"),
        ("render --sizes 1x1", "--sizes"),
        ("render --method magic", "magic"),
        ("render --quality 0", "quality 0"),
        ("render --quality -1", "quality -1"),
        ("render --quality nan", "quality NaN"),
        ("render --quality many", "--quality"),
        ("render --spp 0", "spp 0"),
        ("render --spp -1", "--spp"),
        ("render --spp 1000000000000", "--spp"),
        ("render --spp many", "--spp"),
        ("render --error 0", "--error"),
        ("render --error -0.1", "--error"),
        ("render --error 2", "--error"),
        ("render --error nan", "--error"),
        ("render --error 0.1 --spp 4", "--spp"),
        ("render --coverage round", "--coverage"),
        ("render --trail some", "--trail"),
        ("render --size 0x9", "size 0x9"),
        ("render --size 1000000000x1", "size 1000000000x1"),
        ("render --size 99999999999x1", "--size"),
        ("render --size 640", "--size"),
        ("render --size -4x4", "--size"),
        ("render --seed -1", "--seed"),
        ("render --threads 0", "--threads"),
        ("render --threads 100000", "--threads"),
        ("render --eye 1,2", "--eye"),
        ("render --eye 1,2,nan", "--eye"),
        ("render --at 1e99,0,0", "--at"),
        ("render --at 1e20,0,0", "its numbers must be from -1e9 to 1e9"),
        ("render --eye --at 1,2,3", "--eye"),
        ("render --eye 1,2,3 --at 1,2,3", "--eye and --at"),
        ("render --eye 0,0,0 --at 0,5,0 --up 0,-1,0", "--up"),
        ("render --eye 0,0,0 --at 0,5,0 --up 0,0,0", "--up"),
        ("render --at=-0.1,1.45,3.45", "--eye and --at"), // where the embedded scene's camera stands
        ("render --fov 0", "--fov"),
        ("render --fov 180", "--fov"),
        ("render --fov nan", "--fov"),
        ("render --env-scale -1", "--env-scale"),
        ("render --exposure inf", "--exposure"),
        ("render --exposure 1000", "--exposure"),
        ("render --term shadow", "shadow"),
        ("render --out a.jpg", "--out"),
        ("render --out a", "--out"),
        ("render --out none/a.exr", "none/a.exr"),
        ("render --out a.png --out none/a.exr", "none/a.exr"),
        ("render --stats none/a.json", "none/a.json"),
        ("render a.obj b.obj", "b.obj"),
        ("render none.obj", "none.obj"),
        ("render none.toml", "none.toml"),
        ("render scene.blend", "scene.blend"),
        ("render --env none.exr", "none.exr"),
        ("compare a.exr", "REFERENCE"),
        ("compare a.exr none.exr", "a.exr"),
        ("compare a.exr b.exr --diff d.jpg", "d.jpg"),
        ("compare a.exr b.exr --max psnr=3", "--max"),
        ("compare a.exr b.exr --max flip", "--max"),
        ("explain a.obj 1", "<Y>"),
        ("explain a.obj -1 2", "-1"),
        ("explain none.obj 1 2", "none.obj"),
        ("explain a.obj 1 2 --size 0x1", "size 0x1"),
        ("info", "SCENE|IMAGE"),
        ("info none.exr", "none.exr"),
    ];
    for (words, named) in table {
        let run = freelux_words(folder.path(), words);
        run.expect_refused(2, named);
        assert_eq!(names(folder.path()), [""; 0], "`{words}` leaves nothing behind");
    }
    freelux::<&str>(folder.path(), &[]).expect_refused(2, "subcommand");
}

#[test]
fn negative_numbers_may_follow_a_space_or_an_equals_sign() {
    let folder = folder();
    for camera in ["--eye -278,273,-800 --exposure -1.5", "--eye=-278,273,-800 --exposure=-1.5"] {
        let scene = data("study/cornell/scene.obj");
        let mut args: Vec<&str> = vec!["render", scene.to_str().unwrap()];
        args.extend("--method path --spp 1 --size 2x2 --out a.png".split(' '));
        args.extend(camera.split(' '));
        freelux(folder.path(), &args).expect_done();
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_loading() {
    let folder = folder();
    fs::create_dir(folder.path().join("sub.exr")).unwrap();
    // The scene does not exist: the message names the output, so that was looked at first.
    freelux_words(folder.path(), "render none.obj --out sub.exr").expect_refused(2, "sub.exr: is a folder");
    #[cfg(target_os = "linux")]
    freelux_words(folder.path(), "render none.obj --out /proc/a.exr").expect_refused(2, "/proc/a.exr");
    let kept = folder.path().join("kept.png");
    fs::write(&kept, "old").unwrap();
    let mut rights = fs::metadata(&kept).unwrap().permissions();
    rights.set_readonly(true);
    fs::set_permissions(&kept, rights).unwrap();
    freelux_words(folder.path(), "render none.obj --out kept.png").expect_refused(2, "kept.png: is write-protected");
    assert_eq!(fs::read(&kept).unwrap(), b"old", "the old file is kept");
    assert_eq!(names(folder.path()), ["kept.png", "sub.exr"], "and nothing is added");
}
