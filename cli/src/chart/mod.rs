//! `freelux chart`: error against time, by method and scene, as CSV, SVG and Markdown.

mod lines;
mod record;
mod reference;
mod svg;
mod sweep;
mod table;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use glam::UVec2;
use integrator::SettingsError;
use integrator::metrics::Reference;

use self::record::Record;
use self::sweep::{Subject, Sweep};
use crate::args::{self, Variant};
use crate::failure::{Failure, print};
use crate::files;
use crate::view::pool;

/// Pixels of a scene that asks for no size.
const DEFAULT_SIZE: UVec2 = UVec2::splat(256);

/// Chart error against time: each method renders each scene at several qualities, and each picture is measured against
/// a converged reference.
///
/// Writes chart.csv (a row a picture), SCENE.svg (a chart a scene) and chart.md (times to an error, with ratios) to a
/// folder. A scene's reference is `reference.exr` beside it with its variance in `variance.exr`; where there is none,
/// the path tracer makes one, which is kept in the folder for the next time. Times leave out loading and the tree of
/// boxes.
#[derive(Debug, clap::Args)]
pub(crate) struct ChartArgs {
    /// Scenes (.toml with a camera, or .obj)
    #[arg(value_name = "SCENE", required_unless_present = "add")]
    scenes: Vec<PathBuf>,
    /// Methods, each a line of the chart; with settings for study as reproject+coverage=rect+trail=all
    #[arg(long, value_name = "METHOD,...", value_delimiter = ',', value_parser = args::variant,
          default_value = "reproject,gather,cache-only,path")]
    methods: Vec<Variant>,
    /// Qualities that each method renders at
    #[arg(
        long,
        value_name = "Q,...",
        value_delimiter = ',',
        default_value = "0.1,0.3,1,3,10",
        allow_hyphen_values = true
    )]
    qualities: Vec<f32>,
    /// Folder for what is written, made where it is not there
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Width and height in pixels [default: the scene's, or 256x256]
    #[arg(long, value_name = "WxH", value_parser = args::size, allow_hyphen_values = true)]
    size: Option<UVec2>,
    /// Renderings at each quality, each with a seed of its own: the median of their times and the mean of their errors
    /// count
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000),
          allow_hyphen_values = true)]
    repeat: u32,
    /// A method that took longer than this is not asked for higher qualities
    #[arg(long, value_name = "S", default_value_t = 60.0, value_parser = args::not_negative, allow_hyphen_values = true)]
    max_seconds: f32,
    /// The reference (EXR), for a single scene; of FILE.exr the variance is FILE.variance.exr
    #[arg(long, value_name = "FILE.exr")]
    reference: Option<PathBuf>,
    /// Samples a pixel of a reference that has to be made
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(16..=1 << 20),
          allow_hyphen_values = true)]
    reference_spp: u32,
    /// Seed of the first rendering
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    seed: u64,
    /// Threads [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    threads: Option<u16>,
    /// Rows to add (CSV of another chart or of another program): scene, method, quality, seconds, relmse and robust at
    /// least; may be given several times, and alone it draws charts anew
    #[arg(long, value_name = "FILE.csv")]
    add: Vec<PathBuf>,
}

/// Checks all arguments, then measures in a pool of the threads asked for.
pub(crate) fn run(args: &ChartArgs) -> Result<ExitCode, Failure> {
    let qualities = args.check()?;
    let mut records = Vec::new();
    for path in &args.add {
        records.extend(record::read(path)?);
    }
    let added = records.iter().map(|record| record.scene.clone());
    let names: BTreeSet<String> = added.chain(args.scenes.iter().map(|path| scene_name(path))).collect();
    check_names(&names)?;
    fs::create_dir_all(&args.out).map_err(|error| {
        Failure::Input(format!("{}: the folder cannot be made: {error}; choose another", args.out.display()))
    })?;
    let charts = names.iter().map(|scene| chart_name(scene));
    for name in [CSV, MARKDOWN].map(str::to_owned).into_iter().chain(charts) {
        files::check_writable(&args.out.join(name))?;
    }
    files::await_files(&[&args.out.join(MARKDOWN)]);
    pool(args.threads)?.install(|| args.measure(&qualities, &mut records))?;
    args.write(&records)?;
    Ok(ExitCode::SUCCESS)
}

/// A scene that is to be rendered.
struct Job {
    subject: Subject,
    size: UVec2,
    reference_path: PathBuf,
    /// What lies there; `None` where it is to be made.
    reference: Option<Reference>,
}

/// Names of the files in the folder.
const CSV: &str = "chart.csv";
const MARKDOWN: &str = "chart.md";

impl ChartArgs {
    /// Checks what can be checked before anything is loaded; returns the qualities, rising, each once.
    fn check(&self) -> Result<Vec<f32>, Failure> {
        let mut qualities = self.qualities.clone();
        qualities.sort_by(f32::total_cmp);
        qualities.dedup();
        for &quality in &qualities {
            let size = self.size.unwrap_or(DEFAULT_SIZE);
            let settings = integrator::Settings { quality, size, ..integrator::Settings::default() };
            settings.validate().map_err(|error| match error {
                SettingsError::Quality(_) => Failure::Input(format!("--qualities: {error}")),
                _ => Failure::Input(format!("--{error}")),
            })?;
        }
        if self.reference.is_some() && self.scenes.len() != 1 {
            return Err(Failure::Input("--reference is for one scene; name one".into()));
        }
        for (number, variant) in self.methods.iter().enumerate() {
            if self.methods[..number].iter().any(|other| other.name == variant.name) {
                return Err(Failure::Input(format!("--methods: {} stands there twice; name it once", variant.name)));
            }
        }
        Ok(qualities)
    }

    /// Loads all scenes and the references that there are, so that what is wrong with one is told before another is
    /// rendered.
    fn load(&self) -> Result<Vec<Job>, Failure> {
        let mut jobs: Vec<Job> = Vec::new();
        for path in &self.scenes {
            let name = scene_name(path);
            if jobs.iter().any(|other| other.subject.name == name) {
                let path = path.display();
                return Err(Failure::Input(format!("{path}: a second scene of the name {name}; rename it")));
            }
            let subject = Subject::load(path, name)?;
            let size = self.size.or(subject.size).unwrap_or(DEFAULT_SIZE);
            let reference_path = self.reference_path(path, &subject.name, size);
            // One that was named is read in any case, and so missed.
            let reference = if self.reference.is_some() || reference_path.exists() {
                Some(reference::read(&reference_path, size)?)
            } else {
                reference::check_writable(&reference_path)?;
                None
            };
            jobs.push(Job { subject, size, reference_path, reference });
        }
        Ok(jobs)
    }

    /// Where the reference is: the one that was named, the one beside the scene, or else the one that is made and kept.
    fn reference_path(&self, scene: &Path, name: &str, size: UVec2) -> PathBuf {
        let beside = || Some(scene.with_file_name("reference.exr")).filter(|path| path.exists());
        let kept = || {
            let file = format!("{}.{}x{}.{}spp.exr", file_name(name), size.x, size.y, self.reference_spp);
            self.out.join(file)
        };
        self.reference.clone().or_else(beside).unwrap_or_else(kept)
    }

    /// Renders all scenes. The CSV is written after each picture, so that what was measured is kept whatever happens.
    fn measure(&self, qualities: &[f32], records: &mut Vec<Record>) -> Result<(), Failure> {
        for Job { subject, size, reference_path, reference } in self.load()? {
            let reference = match reference {
                Some(reference) => reference,
                None => reference::make(&reference_path, &subject.scene, &subject.name, size, self.reference_spp)?,
            };
            let sweep = Sweep {
                methods: &self.methods,
                qualities,
                repeats: self.repeat,
                size,
                seed: self.seed,
                max_seconds: self.max_seconds.into(),
            };
            subject.sweep(&sweep, &reference, &reference_path.display().to_string(), &mut |record| {
                records.push(record);
                files::write_all(&[(&self.out.join(CSV), record::to_csv(records))])
            })?;
        }
        Ok(())
    }

    /// Writes the CSV, a chart for each scene and the tables; prints the tables too.
    fn write(&self, records: &[Record]) -> Result<(), Failure> {
        let mut markdown = format!("# Error against time\n\n{}\n", table::LEGEND);
        let mut written = vec![(self.out.join(CSV), record::to_csv(records))];
        let mut scenes: Vec<&str> = Vec::new();
        for record in records {
            if !scenes.contains(&record.scene.as_str()) {
                scenes.push(&record.scene);
            }
        }
        for scene in scenes {
            let of_scene: Vec<&Record> = records.iter().filter(|record| record.scene == scene).collect();
            let lines = lines::lines(records, scene);
            let facts = facts(&of_scene);
            let picture = chart_name(scene);
            let texts = svg::Texts {
                title: scene,
                notes: &facts,
                own: of_scene.iter().find_map(|record| record.reference_robust),
            };
            written.push((self.out.join(&picture), svg::draw(&texts, &lines).into_bytes()));
            markdown.push_str(&table::section(scene, &picture, &facts, &lines));
            markdown.push('\n');
        }
        written.push((self.out.join(MARKDOWN), markdown.clone().into_bytes()));
        let written: Vec<(&Path, Vec<u8>)> =
            written.iter_mut().map(|(path, bytes)| (path.as_path(), std::mem::take(bytes))).collect();
        files::write_all(&written)?;
        print(&markdown)
    }
}

/// What the measurements of a scene have in common, a line each.
fn facts(records: &[&Record]) -> Vec<String> {
    let mut facts = Vec::new();
    let mut add = |fact: String| {
        if !facts.contains(&fact) {
            facts.push(fact);
        }
    };
    for record in records.iter().filter(|record| record.width > 0) {
        let threads = if record.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", record.threads) };
        add(format!("{} x {} pixels, {threads} of {}", record.width, record.height, record.cpu));
    }
    for record in records.iter().filter(|record| !record.version.is_empty()) {
        // Other programs name themselves; our records hold the bare number.
        let is_ours = record.version.starts_with(|first: char| first.is_ascii_digit());
        add(if is_ours { format!("freelux {}", record.version) } else { record.version.clone() });
    }
    for record in records.iter().filter(|record| !record.reference.is_empty()) {
        add(match (record.reference_relmse, record.reference_robust) {
            (Some(plain), Some(robust)) => {
                format!("reference {}, its own relMSE {plain:.1e}, robust {robust:.1e}", record.reference)
            }
            _ => format!("reference {}, its own relMSE unknown and not subtracted", record.reference),
        });
    }
    facts
}

/// A scene by its file, or by its folder where the file is just `scene`.
fn scene_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder =
        fs::canonicalize(path).ok().and_then(|path| Some(path.parent()?.file_name()?.to_string_lossy().into_owned()));
    folder.filter(|_| stem == "scene").unwrap_or(stem)
}

/// Refuses scenes whose charts, and references, would be the same file.
fn check_names(scenes: &BTreeSet<String>) -> Result<(), Failure> {
    let mut by_file = BTreeMap::new();
    for scene in scenes {
        // Some systems take capitals for small letters.
        if let Some(other) = by_file.insert(file_name(scene).to_lowercase(), scene) {
            let what = format!("the charts of the scenes {other} and {scene} would be the same file");
            return Err(Failure::Input(format!("{what}; rename one of them")));
        }
    }
    Ok(())
}

/// The file of a scene's chart.
fn chart_name(scene: &str) -> String {
    format!("{}.svg", file_name(scene))
}

/// A name that every system takes for a file.
fn file_name(scene: &str) -> String {
    let safe = |letter: char| if letter.is_alphanumeric() || "-_".contains(letter) { letter } else { '-' };
    scene.chars().map(safe).collect()
}
