//! What each part of the reprojection is good for: time and error with it and without it, as a table in Markdown.
//!
//! `cargo run --release -p benches --example switches [SCENE]...`, all study scenes without any; a minute for each on
//! two cores.

use benches::renders::{Runs, STUDY_SCENES, processor};
use integrator::metrics::Reference;
use integrator::{Settings, Study};
use tests::STUDY_SIZE;

/// Pictures of each kind, with seeds of their own.
const SEEDS: u64 = 3;

/// What is changed, as the command line has it, and what that means.
const SWITCHES: [(&str, &str); 35] = [
    ("", "default"),
    ("trail=all", "all elements leave trails"),
    ("coverage=rect", "elements cover the rectangle around their corners"),
    ("weights=bits", "shares counted in bits"),
    ("coverage=rect,trail=all,weights=bits,depth=layer", "the paper's own variant"),
    ("verify=0", "no verification rays"),
    ("verify=4", "16 verification rays"),
    ("merge=1", "elements not merged"),
    ("sides=even", "elements of up to 4 texels along a side at every distance"),
    ("depth=layer", "elements within one layer"),
    ("layers=8", "8 layers"),
    ("layers=32", "32 layers"),
    ("step=1", "a hole ray a texel"),
    ("step=3", "a hole ray for up to 3 x 3 texels"),
    ("reach=distance", "records of irradiance reach 0.3 of the harmonic mean distance"),
    ("gradients=off", "records of irradiance without gradients"),
    ("walls=off", "records of irradiance reach through walls"),
    ("clamp=off", "records of irradiance reach as far as they say, whatever their neighbours do"),
    ("gaps=off", "records of irradiance reach into thin gaps"),
    ("limit=off", "records reach farther than a quarter of the picture"),
    ("trail=silhouettes", "trails as long as the way of their silhouettes"),
    ("margins=off", "retreating silhouettes keep their last texel"),
    ("doubt=off", "no doubt of what a record above a point could not see"),
    ("divide=off", "one ray for each texel of a gather"),
    ("highlights=off", "highlights taken from records"),
    ("samples=even", "16 primary samples for each pixel"),
    ("light-samples=1", "1 light sample"),
    ("clear-lights=off", "shadow rays to lights that nothing hides, too"),
    ("direct-fit=off", "direct light in half shadows by each pixel for itself"),
    ("gather-guide=off", "gathers look everywhere alike"),
    ("lobe-guide=off", "lobes alone choose where gloss looks"),
    ("lobe-reuse=off", "each primary sample traces its own lobe"),
    ("texture-alpha=0", "gloss read from textures"),
    ("secondary=photons", "photon map at secondary hits"),
    ("secondary=paths", "paths from secondary hits on"),
];

fn study(switch: &str) -> Study {
    let mut study = Study::default();
    for (name, value) in switch.split(',').filter_map(|setting| setting.split_once('=')) {
        study.set(name, value).expect("a setting that exists");
    }
    study
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    println!("{}, {} threads\n", processor(), rayon::current_num_threads());
    println!("| scene | changed | that is | seconds | relMSE | robust | ratio of means |");
    println!("|---|---|---|---|---|---|---|");
    for name in STUDY_SCENES {
        if !(wanted.is_empty() || wanted.iter().any(|wanted| wanted == name)) {
            continue;
        }
        let tests::Study { scene, reference, variance, .. } = tests::Study::open(name);
        let reference = Reference::new(STUDY_SIZE, reference, Some(variance)).expect("a full picture");
        let mut runs: Vec<Runs> = SWITCHES.iter().map(|_| Runs::default()).collect();
        // They take turns, so that a machine that is slow for a while is so for all.
        for seed in 0..SEEDS {
            for ((switch, _), runs) in SWITCHES.iter().zip(&mut runs) {
                let settings = Settings { size: STUDY_SIZE, seed, study: study(switch), ..Settings::default() };
                runs.add(&scene, &settings, &reference);
            }
        }
        for ((switch, meaning), runs) in SWITCHES.iter().zip(&runs) {
            let [plain, robust] = runs.errors(&reference).expect("a finite reference");
            let switch = if switch.is_empty() { "-".to_owned() } else { format!("`{switch}`") };
            println!(
                "| {name} | {switch} | {meaning} | {:.2} | {plain} | {robust} | {:.4} |",
                runs.seconds(),
                runs.ratio()
            );
        }
    }
}
