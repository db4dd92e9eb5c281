//! How each method fares as a thing gets harder, against closed forms: error and time in tables in Markdown and in a
//! chart.
//!
//! `cargo run --release -p benches --example stability [SWEEP]... [FILE.svg]`, all sweeps without a name; five minutes
//! on two cores. FILE.svg becomes the chart of the errors.

use std::time::Instant;

use benches::plot::{Panel, side_by_side};
use benches::renders::processor;
use tests::graded::{Graded, ball_lamp, glowing_room, half_sky, slit, wedge};
use tests::{Effort, METHODS, Pictures, Term};

/// What every picture may cost: quality 1, with as many samples as keep the noise of `path` near one percent where
/// nothing is hard.
const EFFORT: Effort = Effort { side: 32, seeds: 4, path_spp: 256, spp: 8, quality: 1.0, direct_fit: true };

/// A thing that gets harder from value to value.
struct Sweep {
    name: &'static str,
    /// What the values are, with their unit.
    what: &'static str,
    values: &'static [f32],
    scene: fn(f32) -> Graded,
}

const SWEEPS: [Sweep; 7] = [
    Sweep {
        name: "gap",
        what: "height of a slit, 1 m behind its mouth",
        values: &[1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001],
        scene: slit,
    },
    Sweep {
        name: "corner",
        what: "degrees of a wedge of albedo 0.5",
        values: &[170.0, 120.0, 90.0, 60.0, 30.0, 10.0, 5.0],
        scene: |degrees| wedge(degrees, 0.5, 1e4, 1.0, degrees.min(60.0) / 2.0),
    },
    Sweep {
        name: "seam",
        what: "distance from the seam of a right angle of planes of 100 m, m",
        values: &[0.3, 0.1, 1e-2, 1e-3, 1e-4, 1e-5],
        scene: |distance| wedge(90.0, 0.5, 100.0, distance, 60.0),
    },
    Sweep {
        name: "grazing",
        what: "elevation of the eye over a plane of a right angle, degrees",
        values: &[60.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03],
        scene: |elevation| wedge(90.0, 0.5, 1e4, 1.0, elevation),
    },
    Sweep {
        name: "lamp",
        what: "radius of a ball that shines from 2 m, m",
        values: &[1.0, 0.1, 1e-2, 1e-3, 1e-4],
        scene: ball_lamp,
    },
    Sweep {
        name: "albedo",
        what: "albedo of a closed room of emitters",
        values: &[0.5, 0.8, 0.9, 0.95, 0.99],
        scene: glowing_room,
    },
    Sweep {
        name: "offset",
        what: "distance of the origin from half a sky, m",
        values: &[1.0, 10.0, 100.0, 1e3, 1e4, 1e5],
        scene: half_sky,
    },
];

/// What one method made of one scene.
struct Outcome {
    /// Deviation of the mean from 1, and its standard error.
    bias: f64,
    noise: f64,
    /// Of the worst block of 4 x 4 pixels.
    worst: f64,
    /// Of one picture.
    seconds: f64,
}

fn outcomes(graded: &Graded) -> Vec<Outcome> {
    let outcome = |method| {
        let start = Instant::now();
        let pictures = Pictures::new(&graded.scene, method, &EFFORT);
        let seconds = start.elapsed().as_secs_f64() / EFFORT.seeds as f64;
        let measured = pictures.relative(Term::All, &graded.known);
        Outcome { bias: measured.mean - 1.0, noise: measured.standard_error, worst: measured.worst, seconds }
    };
    METHODS.map(outcome).into()
}

#[expect(clippy::print_stdout, reason = "the tables are the result")]
fn table(sweep: &Sweep) -> Vec<Vec<Outcome>> {
    println!("\n**{}**: {}\n", sweep.name, sweep.what);
    let columns = METHODS.map(|method| format!("{}: mean, % | worst, % | s", method.name()));
    println!("| {} | {} |", sweep.name, columns.join(" | "));
    println!("{}|", "|---".repeat(1 + 3 * METHODS.len()));
    let row = |value: &f32| {
        let outcomes = outcomes(&(sweep.scene)(*value));
        let cells = outcomes.iter().map(|outcome| {
            let [bias, noise, worst] = [outcome.bias, outcome.noise, outcome.worst].map(|share| 100.0 * share);
            format!("{bias:+.2} ± {noise:.2} | {worst:.1} | {:.3}", outcome.seconds)
        });
        println!("| {value} | {} |", cells.collect::<Vec<_>>().join(" | "));
        outcomes
    };
    sweep.values.iter().map(row).collect()
}

/// The worst block of each method over the values of a sweep.
fn panel<'a>(sweep: &'a Sweep, rows: &[Vec<Outcome>]) -> Panel<'a> {
    let line = |number: usize| {
        let points = sweep.values.iter().zip(rows).map(|(value, row)| (f64::from(*value), row[number].worst));
        let mut points: Vec<(f64, f64)> = points.collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        (METHODS[number].name(), points)
    };
    let lines = (0..METHODS.len()).map(line).collect();
    Panel { title: "error of the worst block of 4 x 4 pixels", below: sweep.what, lines }
}

#[expect(clippy::print_stdout, reason = "the tables are the result")]
fn main() {
    let (charts, wanted): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|arg| arg.ends_with(".svg"));
    for name in &wanted {
        assert!(SWEEPS.iter().any(|sweep| sweep.name == name), "there is no sweep {name}");
    }
    let Effort { side, seeds, path_spp, .. } = EFFORT;
    println!("{}, {} threads; {seeds} pictures of {side} x {side}", processor(), rayon::current_num_threads());
    println!("`path` with {path_spp} samples a pixel, the others at quality 1; errors relative to the closed form");
    let is_wanted = |sweep: &&Sweep| wanted.is_empty() || wanted.iter().any(|name| name == sweep.name);
    let panels: Vec<Panel> = SWEEPS.iter().filter(is_wanted).map(|sweep| panel(sweep, &table(sweep))).collect();
    for file in charts {
        std::fs::write(&file, side_by_side(&panels)).unwrap_or_else(|error| panic!("{file}: {error}"));
    }
}
