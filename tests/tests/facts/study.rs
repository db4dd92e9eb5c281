//! The study scenes against their converged references (see `data/study/README.md`).
//!
//! The quick run takes a few samples of the two smaller scenes; the long one all of them:
//!
//! ```text
//! FREELUX_FULL=1 cargo test --release -p tests --test facts study -- --nocapture
//! ```

use glam::Vec3;
use integrator::metrics::{Image, Reference, ratio_of_means, rel_mse};
use integrator::{Method, Settings, render, render_to_error};
use tests::{Blocks, Exceeded, STUDY_SIZE, Study, is_full, print};

fn pictures(study: &Study, seeds: u64, spp: u32) -> Vec<Vec<Vec3>> {
    (0..seeds)
        .map(|seed| {
            let spp = Some(spp);
            let settings = Settings { method: Method::Path, size: STUDY_SIZE, spp, seed, ..Settings::default() };
            render(&study.scene, &settings, &|_| ()).expect("valid settings").film.picture()
        })
        .collect()
}

/// Asserts that the path tracer has no bias: by blocks of `block` x `block` pixels and in the whole mean; and that the
/// same test finds 1 %.
fn assert_unbiased(name: &str, seeds: u64, spp: u32, block: usize) {
    let study = Study::open(name);
    let pictures = pictures(&study, seeds, spp);
    let blocks = Blocks::compare(&study, &pictures, block, 1.0);
    print(&format!("{name}, {seeds} x {spp} spp: {blocks:?}, whole {:.2}", blocks.whole()));
    // Three channels that move together: 3.3 standard errors are 1 in 1000.
    assert!(blocks.whole() < WHOLE, "{name}: {blocks:?}");
    // The limit at 1 % for so many blocks and channels, by the t distribution of the pooled spread: 768 blocks of 16 x
    // 16 with some 300 degrees of freedom (the pixels of a block are not equally noisy), 3072 of 8 x 8 with some 100.
    let limit = if block == 16 { 4.45 } else { 4.95 };
    assert!(blocks.worst < limit, "{name}: {blocks:?}");
    let planted = Blocks::compare(&study, &pictures, block, 1.01);
    print(&format!(
        "{name}, reference 1 % too bright: whole {:.2}, mean of z^2 {:.3}",
        planted.whole(),
        planted.mean_sq
    ));
    assert!(planted.whole() > WHOLE, "{name}: an error of 1 % is not found");
}

/// Largest deviation of the mean of all pixels, standard errors.
const WHOLE: f64 = 3.3;

#[test]
fn path_has_no_bias() {
    assert_unbiased("cornell", 4, 4, 16);
    if is_full() {
        assert_unbiased("cornell", 4, 64, 8);
        // Gloss in gloss has heavy tails: fewer samples give blocks of pixels with too small a spread.
        assert_unbiased("cornell-glossy", 8, 128, 8);
        assert_unbiased("atrium-env", 8, 256, 8);
    }
}

#[test]
fn caches_reach_their_error() {
    // Robust relMSE with default settings, the reference's own subtracted, at most three times what it is, plain at
    // most twice robust, and the mean within 1 %.
    let limits = [("cornell", 1.8e-4), ("cornell-glossy", 5.5e-4), ("atrium-env", 2.2e-3)];
    for &(name, limit) in if is_full() { &limits[..] } else { &limits[..1] } {
        let study = Study::open(name);
        for method in [Method::Reproject, Method::CacheOnly] {
            let settings = Settings { method, size: STUDY_SIZE, ..Settings::default() };
            let picture = render(&study.scene, &settings, &|_| ()).expect("valid settings").film.picture();
            let image = Image::new(STUDY_SIZE, &picture).expect("the size asked for");
            let error = rel_mse(&image, &study.image()).expect("two pictures of one size");
            let ratio = ratio_of_means(&image, &study.image()).expect("two pictures of one size").overall;
            let (robust, plain) = (error.robust - study.own_error, error.plain - study.own_error);
            let what =
                format!("{name}, {}: robust relMSE {robust:.2e}, plain {plain:.2e}, ratio {ratio:.4}", method.name());
            print(&what);
            assert!(robust < limit && plain < 2.0 * robust && (ratio - 1.0).abs() < 0.01, "{what}");
        }
    }
}

/// The floor before the tall block of cornell-glossy, and the side of the block that is seen at a grazing angle: gloss
/// that shows gloss. Left, top, width and height in pixels.
const GLOSS_IN_GLOSS: [[usize; 4]; 2] = [[60, 215, 64, 30], [72, 112, 7, 98]];

#[test]
fn gloss_seen_in_gloss_keeps_its_light() {
    // Numbers that one sample used twice, for its lobe and for the lobe of what that met, made the floor 3 % too dark;
    // textures 20 % the block.
    const SEEDS: u64 = 3;
    let study = Study::open("cornell-glossy");
    let pictures: Vec<Vec<Vec3>> = (0..SEEDS)
        .map(|seed| {
            let settings = Settings { size: STUDY_SIZE, quality: 0.3, seed, ..Settings::default() };
            render(&study.scene, &settings, &|_| ()).expect("valid settings").film.picture()
        })
        .collect();
    let reference = study.image();
    for [left, top, width, height] in GLOSS_IN_GLOSS {
        let sum = |pixels: &[Vec3]| -> f32 {
            let row = |y: usize| &pixels[y * STUDY_SIZE.x as usize + left..][..width];
            (top..top + height).flat_map(row).map(|pixel| pixel.element_sum()).sum()
        };
        let mean = pictures.iter().map(|picture| sum(picture)).sum::<f32>() / SEEDS as f32;
        let ratio = mean / sum(reference.pixels());
        print(&format!("{width} x {height} pixels of gloss in gloss: ratio {ratio:.4}"));
        // Three deviations of the three pictures.
        assert!((ratio - 1.0).abs() < 0.015, "at {left}, {top}: ratio {ratio}");
    }
}

#[test]
fn stated_error_holds_for_95_percent() {
    let (names, error): (&[&str], f32) =
        if is_full() { (&["cornell", "cornell-glossy", "atrium-env"], 0.05) } else { (&["cornell"], 0.1) };
    for name in names {
        let study = Study::open(name);
        let settings = Settings { size: STUDY_SIZE, ..Settings::default() };
        let (rendering, estimate) =
            render_to_error(&study.scene, &settings, error, &|_| (), &|_| ()).expect("valid settings");
        let reference = Reference::new(STUDY_SIZE, study.reference.clone(), Some(study.variance.clone()));
        let exceeded =
            Exceeded::new(&rendering.film.picture(), &estimate, &reference.expect("pictures of the stated size"));
        let (failed, all) = (exceeded.of_400(), exceeded.share());
        let what = format!(
            "{name}, error {error}: {failed} of 400 pixels beyond their estimates, {all:.4} of all; {} passes, bias {:.4}",
            estimate.passes, estimate.bias
        );
        print(&what);
        // Of 400 with a probability of 0.05 each, more than 31 fail in one of 100 cases.
        assert!(estimate.is_reached && failed <= 31, "{what}");
        // An estimate that is so fearful that nothing ever exceeds it tells nothing.
        assert!(all > 0.001, "{what}");
    }
}
