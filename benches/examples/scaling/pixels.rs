//! The same picture in more pixels: what is new to see is not four times as much in four times as many.

use benches::renders::{STUDY_SCENES, exponent, render};
use glam::UVec2;
use integrator::Settings;
use tests::Study;

/// Width and height of the pictures.
const SIDES: [u32; 4] = [128, 256, 512, 1024];

#[expect(clippy::print_stdout, reason = "the table is the result")]
pub(super) fn table() {
    println!("| scene | side | seconds | direct | indirect | points | looked | records | of irradiance |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in STUDY_SCENES {
        let scene = Study::open(name).scene;
        let mut columns: [Vec<(f64, f64)>; 7] = Default::default();
        for side in SIDES {
            let settings = Settings { size: UVec2::splat(side), ..Settings::default() };
            let s = render(&scene, &settings).statistics;
            let (direct, indirect) = (s.seconds("direct"), s.seconds("indirect"));
            // Those that had to look for themselves, by reprojection or by rays.
            let looked = s.reprojected + s.gathered;
            println!(
                "| {name} | {side} | {:.2} | {direct:.2} | {indirect:.2} | {} | {looked} | {} | {} |",
                s.render_seconds, s.surface_points, s.records, s.irradiance_records
            );
            let counts = [s.surface_points, looked, s.records, s.irradiance_records].map(|count| count as f64);
            let values = [s.render_seconds, direct, indirect].into_iter().chain(counts);
            for (column, value) in columns.iter_mut().zip(values) {
                column.push((f64::from(side).powi(2), value));
            }
        }
        let exponents: Vec<String> = columns.iter().map(|column| format!("{:.2}", exponent(column))).collect();
        println!("| {name} | **exponent** | {} |", exponents.join(" | "));
    }
}
