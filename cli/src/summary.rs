//! What a rendering counted and how long it took: a table for people, JSON for programs.

use std::fmt::Write;

use integrator::{ErrorEstimate, Method, Statistics};
use serde::Serialize;

/// All that is told at the end of a rendering; as JSON the statistics stand at the top level too.
#[derive(Debug, Serialize)]
pub(crate) struct Summary<'a> {
    /// Version of these fields.
    pub(crate) version: u32,
    /// Version of the program.
    pub(crate) freelux: &'a str,
    /// The command with all that changes the picture.
    pub(crate) command: &'a str,
    /// The scene's file.
    pub(crate) scene: &'a str,
    pub(crate) method: Method,
    pub(crate) quality: f32,
    /// Width and height, pixels.
    pub(crate) size: [u32; 2],
    pub(crate) seed: u64,
    pub(crate) threads: usize,
    /// Of the PNG, stops.
    pub(crate) exposure: f32,
    /// Reading and checking files.
    pub(crate) load_seconds: f64,
    /// Building the tree.
    pub(crate) build_seconds: f64,
    /// Building the tables of lights.
    pub(crate) light_seconds: f64,
    /// Encoding the pictures and bringing them to the disk.
    pub(crate) encode_seconds: f64,
    /// Largest memory of the whole process so far, bytes; null where the system does not tell.
    pub(crate) peak_memory_bytes: Option<u64>,
    /// Where an error was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) error: Option<ErrorSummary>,
    /// `render_seconds` and the rest.
    #[serde(flatten)]
    pub(crate) statistics: &'a Statistics,
}

/// What became of an error that was asked for.
#[derive(Debug, Serialize)]
pub(crate) struct ErrorSummary {
    /// The relative error asked for.
    asked: f32,
    /// Share of the pixels that are estimated to be within it.
    share: f32,
    /// Root mean square of the relative bias.
    bias: f32,
    /// Pictures that were averaged.
    passes: u32,
    /// Whether it is reached in 95 % of the pixels.
    is_reached: bool,
}

impl ErrorSummary {
    pub(crate) fn new(asked: f32, estimate: &ErrorEstimate) -> Self {
        let &ErrorEstimate { share, bias, passes, is_reached, .. } = estimate;
        Self { asked, share, bias, passes, is_reached }
    }

    fn row(&self) -> String {
        let Self { asked, share, bias, passes, is_reached } = self;
        let verdict = if *is_reached { "" } else { ": not reached" };
        format!(
            "{:.3} % or less in {:.1} % of the pixels{verdict}; bias {:.2} %, {passes} passes",
            100.0 * asked,
            100.0 * share,
            100.0 * bias
        )
    }
}

/// One line on how far passes have come towards the relative error `asked` for.
pub(crate) fn error_so_far(asked: f32, so_far: &ErrorEstimate) -> String {
    let [reached, asked] = [so_far.reached(), asked].map(|relative| 100.0 * relative);
    format!("{} passes: within {reached:.3} % in 95 % of the pixels, {asked:.3} % asked", so_far.passes)
}

impl Summary<'_> {
    /// Present version of the JSON.
    pub(crate) const VERSION: u32 = 1;

    /// The JSON, indented, with a line's end.
    pub(crate) fn json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("numbers, text and lists");
        text.push('\n');
        text
    }

    /// The table, a few lines; what the method does not do is left out.
    pub(crate) fn table(&self) -> String {
        let s = self.statistics;
        let mut table = Table::default();
        let [width, height] = self.size;
        let threads = if self.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", self.threads) };
        let head = format!(
            "{} at quality {}, {width} x {height}, seed {}, {threads}",
            self.method.name(),
            self.quality,
            self.seed
        );
        table.row("method", head);

        let mut seconds =
            vec![("load", self.load_seconds), ("build", self.build_seconds), ("light tables", self.light_seconds)];
        seconds.extend(s.phases.iter().map(|phase| (phase.name.as_str(), phase.seconds)));
        seconds.push(("encode", self.encode_seconds));
        let seconds = seconds.iter().map(|(name, seconds)| format!("{name} {seconds:.2}"));
        table.row("seconds", seconds.collect::<Vec<_>>().join(", "));
        if let Some(error) = &self.error {
            table.row("error", error.row());
        }
        table.row("rendered in", format!("{:.2} s", s.render_seconds));

        let rays = [
            ("camera", s.rays.camera),
            ("shadow", s.rays.shadow),
            ("path", s.rays.path),
            ("gather", s.rays.gather),
            ("hole", s.rays.hole),
            ("photon", s.rays.photon),
        ];
        table.counts("rays", &rays);
        table.counts(
            "indirect",
            &[
                ("surface points", s.surface_points),
                ("records", s.records),
                ("of irradiance", s.irradiance_records),
                ("reprojected", s.reprojected),
                ("interpolated", s.interpolated),
                ("gathered", s.gathered),
            ],
        );
        if s.reprojected > 0 {
            let percent = |share: f64| 100.0 * share;
            table.row(
                "hemisphere",
                format!(
                    "filled {:.1} %, unknown {:.1} %, holes {:.1} %",
                    percent(s.share_filled),
                    percent(s.share_unknown),
                    percent(s.share_holes)
                ),
            );
        }
        table.counts(
            "photons",
            &[("shot", s.photons_shot), ("global", s.photons_global), ("caustic", s.photons_caustic)],
        );
        table.counts("samples lost", &[("not finite", s.dropped_samples), ("cut at the longest path", s.cut_paths)]);
        let peak = self.peak_memory_bytes.map_or("unknown".to_owned(), megabytes);
        let kinds = [
            ("scene", s.memory.scene),
            ("photons", s.memory.photons),
            ("cells", s.memory.cells),
            ("records", s.memory.records),
            ("of irradiance", s.memory.irradiance_records),
            ("film", s.memory.film),
        ];
        let present = kinds.iter().filter(|(_, bytes)| *bytes > 0);
        let kinds: String = present.map(|(what, bytes)| format!(", {what} {}", megabytes(*bytes))).collect();
        table.row("memory", format!("{peak} at its peak{kinds}"));
        table.row("exposure", format!("{:+.2} EV", self.exposure));
        table.text
    }
}

/// Rows with a name at the left.
#[derive(Debug, Default)]
struct Table {
    text: String,
}

impl Table {
    fn row(&mut self, name: &str, value: String) {
        let _ = writeln!(self.text, "{name:>12}  {value}");
    }

    /// A row of the counts that are not 0; none where all are.
    fn counts(&mut self, name: &str, counts: &[(&str, u64)]) {
        let present = counts.iter().filter(|(_, count)| *count > 0);
        let words: Vec<String> = present.map(|(what, count)| format!("{what} {}", grouped(*count))).collect();
        if !words.is_empty() {
            self.row(name, words.join(", "));
        }
    }
}

/// Digits in groups of three.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

fn megabytes(bytes: u64) -> String {
    format!("{:.0} MB", bytes as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use integrator::{Memory, Phase, RayCounts};

    use super::*;

    fn summary(statistics: &Statistics) -> Summary<'_> {
        Summary {
            version: Summary::VERSION,
            freelux: "0.0.0",
            command: "freelux render",
            scene: "a.obj",
            method: Method::Reproject,
            quality: 1.0,
            size: [640, 360],
            seed: 7,
            threads: 2,
            exposure: -0.5,
            load_seconds: 0.25,
            build_seconds: 0.5,
            light_seconds: 0.01,
            encode_seconds: 0.125,
            peak_memory_bytes: Some(123_456_789),
            error: None,
            statistics,
        }
    }

    #[test]
    fn the_table_tells_what_happened_and_nothing_else() {
        let statistics = Statistics {
            render_seconds: 1.5,
            phases: vec![Phase { name: "photons".into(), seconds: 1.25 }],
            rays: RayCounts { camera: 1_234_567, ..RayCounts::default() },
            memory: Memory { film: 21_000_000, ..Memory::default() },
            ..Statistics::default()
        };
        let table = summary(&statistics).table();
        for words in [
            "seconds  load 0.25, build 0.50, light tables 0.01, photons 1.25, encode 0.12",
            "camera 1 234 567",
            "123 MB at its peak, film 21 MB",
            "-0.50 EV",
        ] {
            assert!(table.contains(words), "{words} in\n{table}");
        }
        for words in ["hole", "hemisphere", "records", "lost"] {
            assert!(!table.contains(&format!("{words} ")), "no {words} in\n{table}");
        }
    }

    #[test]
    fn json_has_the_statistics_at_its_top_level() {
        let statistics = Statistics { render_seconds: 1.5, records: 12, ..Statistics::default() };
        let json: serde_json::Value = serde_json::from_str(&summary(&statistics).json()).unwrap();
        assert_eq!(json["render_seconds"], 1.5, "the time");
        assert_eq!(json["records"], 12, "a count");
        assert_eq!(json["method"], "reproject", "the method by its name");
        assert_eq!(json["peak_memory_bytes"], 123_456_789, "the peak");
    }

    #[test]
    fn digits_are_grouped() {
        assert_eq!([1, 999, 1000, 1_234_567].map(grouped), ["1", "999", "1 000", "1 234 567"], "by three");
    }
}
