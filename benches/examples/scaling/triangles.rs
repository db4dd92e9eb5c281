//! The same room in ever more triangles.

use std::fs;
use std::time::Instant;

use benches::plot::{Panel, side_by_side};
use benches::renders::{exponent, forget_peak, peak_bytes, render};
use glam::UVec2;
use integrator::Settings;

use super::relief;

/// About so many triangles.
const COUNTS: [usize; 5] = [1_000, 10_000, 100_000, 1_000_000, 10_000_000];

/// Prints the table, and writes the chart to `chart` if asked for.
#[expect(clippy::print_stdout, reason = "the table is the result")]
pub(super) fn table(chart: Option<&str>) {
    println!(
        "| triangles | build s | peak MB | bytes a triangle | render s | direct | indirect | records | bytes each | of irradiance | bytes each | peak MB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let settings = Settings { size: UVec2::splat(256), ..Settings::default() };
    let mut columns: [Vec<(f64, f64)>; 7] = Default::default();
    for count in COUNTS {
        let (description, count) = relief::description(count);
        forget_peak();
        let start = Instant::now();
        let scene = relief::scene(description);
        let build = start.elapsed().as_secs_f64();
        let build_peak = megabytes();
        forget_peak();
        let s = render(&scene, &settings).statistics;
        let render_peak = megabytes();
        let each = |bytes: u64, count: u64| bytes as f64 / count.max(1) as f64;
        println!(
            "| {count} | {build:.3} | {build_peak:.0} | {:.0} | {:.2} | {:.2} | {:.2} | {} | {:.0} | {} | {:.0} | {render_peak:.0} |",
            each(s.memory.scene, count as u64),
            s.render_seconds,
            s.seconds("direct"),
            s.seconds("indirect"),
            s.records,
            each(s.memory.records, s.records),
            s.irradiance_records,
            each(s.memory.irradiance_records, s.irradiance_records),
        );
        let records = (s.records + s.irradiance_records) as f64;
        let [scene_bytes, record_bytes] =
            [s.memory.scene, s.memory.records + s.memory.irradiance_records].map(|bytes| bytes as f64 / 1e6);
        let values = [build, s.render_seconds, records, scene_bytes, record_bytes, build_peak, render_peak];
        for (column, value) in columns.iter_mut().zip(values) {
            column.push((count as f64, value));
        }
    }
    let [build, render, records, scene, ..] = columns.each_ref().map(|column| exponent(column));
    println!(
        "\nExponents: build {build:.2}, render {render:.2}, records {records:.2}, memory of the scene {scene:.2}."
    );
    if let Some(path) = chart {
        let [build, render, _, scene_bytes, record_bytes, build_peak, render_peak] = columns;
        let panel = |title, lines| Panel { title, below: "triangles", lines };
        let svg = side_by_side(&[
            panel("seconds", vec![("tree of boxes", build), ("rendering, 256 x 256", render)]),
            panel(
                "MB",
                vec![
                    ("scene", scene_bytes),
                    ("records", record_bytes),
                    ("peak of building", build_peak),
                    ("peak of rendering", render_peak),
                ],
            ),
        ]);
        fs::write(path, svg).expect("a file that can be written");
    }
}

/// The largest resident size since it was forgotten; NaN where nobody knows.
fn megabytes() -> f64 {
    peak_bytes().map_or(f64::NAN, |bytes| bytes as f64 / 1e6)
}
