//! One thread against two, in turns.

use benches::renders::{STUDY_SCENES, median, render, with_threads};
use integrator::{Settings, Statistics};
use tests::{STUDY_SIZE, Study};

/// Renderings with each number of threads.
const REPEATS: usize = 3;

#[expect(clippy::print_stdout, reason = "the table is the result")]
pub(super) fn table() {
    println!("| scene | phase | seconds on 1 thread | on 2 | times as fast |");
    println!("|---|---|---|---|---|");
    for name in STUDY_SCENES {
        let scene = Study::open(name).scene;
        let settings = Settings { size: STUDY_SIZE, ..Settings::default() };
        let mut runs: [Vec<Statistics>; 2] = Default::default();
        for _ in 0..REPEATS {
            for (of_threads, threads) in runs.iter_mut().zip([1, 2]) {
                of_threads.push(with_threads(threads, || render(&scene, &settings).statistics));
            }
        }
        let row = |phase: &str, seconds: &dyn Fn(&Statistics) -> f64| {
            let [one, two] = runs.each_ref().map(|runs| median(runs.iter().map(seconds).collect()));
            println!("| {name} | {phase} | {one:.3} | {two:.3} | {:.2} |", one / two);
        };
        row("all", &|s| s.render_seconds);
        for phase in &runs[0][0].phases {
            row(&phase.name, &|s| s.seconds(&phase.name));
        }
    }
}
