//! How cost grows: with the pixels, with the triangles and with the threads, as tables in Markdown.
//!
//! `cargo run --release -p benches --example scaling [pixels|triangles|threads]... [FILE.svg]`, all tables without a
//! name; about five minutes on two cores. FILE.svg becomes the chart of time and memory against triangles, both
//! logarithmic.

mod pixels;
mod relief;
mod threads;
mod triangles;

/// The tables.
const TABLES: [&str; 3] = ["pixels", "triangles", "threads"];

#[expect(clippy::print_stdout, reason = "the tables are the result")]
fn main() {
    let (charts, wanted): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|arg| arg.ends_with(".svg"));
    for name in &wanted {
        assert!(TABLES.contains(&name.as_str()), "there is no table {name}");
    }
    println!("{}, {} threads", benches::renders::processor(), rayon::current_num_threads());
    for name in TABLES {
        if !wanted.is_empty() && !wanted.iter().any(|wanted| wanted == name) {
            continue;
        }
        println!("\n### {name}\n");
        match name {
            "pixels" => pixels::table(),
            "triangles" => triangles::table(charts.first().map(String::as_str)),
            _ => threads::table(),
        }
    }
}
