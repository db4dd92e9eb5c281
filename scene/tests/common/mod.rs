#![allow(unreachable_pub, dead_code, reason = "each test file uses its part")]
//! What the tests of the readers share: scenes from strings, in a folder that goes away.

use std::fs;
use std::path::Path;

use scene::{LoadError, LoadOptions, Loaded, Scene, load};

/// Writes `files` to a folder and loads the first; the error comes as its text without the folder.
pub fn load_files(files: &[(&str, &[u8])]) -> Result<Loaded, String> {
    load_files_with(files, &LoadOptions::default())
}

/// As [`load_files`], with options; a relative environment is one of `files`.
pub fn load_files_with(files: &[(&str, &[u8])], options: &LoadOptions) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a name in the folder")).expect("a folder");
        fs::write(path, bytes).expect("a file");
    }
    let environment = options.environment.as_ref().map(|name| folder.path().join(name));
    let options = LoadOptions { environment, ..options.clone() };
    let loaded = load(&folder.path().join(files[0].0), &options).map_err(|error| text_of(&error, folder.path()))?;
    assert_builds(&loaded);
    Ok(loaded)
}

/// Asserts that a scene can be made of what was loaded: the readers leave nothing wrong.
pub fn assert_builds(loaded: &Loaded) {
    if let Err(error) = Scene::new(loaded.description.clone()) {
        panic!("what was loaded cannot be built: {error}");
    }
}

/// The text of an error, which is one line and says what to do, with paths relative to `folder`.
pub fn text_of(error: &LoadError, folder: &Path) -> String {
    let text = error.to_string().replace(&format!("{}/", folder.display()), "");
    assert!(!text.contains('\n'), "one line: {text}");
    assert!(text.contains("; "), "what and what to do: {text}");
    text
}

/// Asserts that the files are refused with a message that starts and continues so.
pub fn assert_refused(files: &[(&str, &[u8])], start: &str, part: &str) {
    match load_files(files) {
        Ok(_) => panic!("{:.200} loads, wanted: {start} ... {part}", String::from_utf8_lossy(files[0].1)),
        Err(text) => {
            assert!(text.starts_with(start) && text.contains(part), "wanted: {start} ... {part}; found: {text}")
        }
    }
}
