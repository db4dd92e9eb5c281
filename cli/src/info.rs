//! `freelux info`: what a scene or a picture holds, on stdout.

use std::fmt::{Display, Write};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{AttributeValue, Text};
use glam::{DVec3, Vec3};
use scene::{Description, LoadOptions, Picture, PictureFormat, PunctualLight, Scene, SpecularKind, read_file};

use crate::failure::{Failure, note, print, printable};

/// Tell what a scene or a picture holds.
#[derive(Debug, clap::Args)]
pub(crate) struct InfoArgs {
    /// Scene (.toml or .obj) or picture (EXR, HDR, PNG or JPEG)
    #[arg(value_name = "SCENE|IMAGE")]
    file: PathBuf,
    /// Print the free forms of a scene as text that scene files take
    #[arg(long)]
    forms: bool,
}

/// Reads the file, by its name a scene or by its content a picture, and prints what it holds.
pub(crate) fn run(args: &InfoArgs) -> Result<ExitCode, Failure> {
    let path = args.file.as_path();
    let suffix = path.extension().and_then(|suffix| suffix.to_str()).map(str::to_ascii_lowercase);
    let text = match suffix.as_deref() {
        Some("toml" | "obj") if args.forms => forms(path)?,
        Some("toml" | "obj") => scene(path)?.0,
        _ if args.forms => return Err(Failure::Input(format!("{}: a picture has no forms", path.display()))),
        _ => picture(path)?.0,
    };
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// The forms of a scene as tables of a scene file: name and text of each, without its material, its copies and its
/// projection.
fn forms(path: &Path) -> Result<String, Failure> {
    let loaded = load(path)?;
    let mut text = String::new();
    for form in &loaded.description.forms {
        let name: String = form.name.chars().flat_map(escaped).collect();
        let _ = writeln!(text, "[[form]]\nname = \"{name}\"\ntext = \"\"\"\n{}\n\"\"\"\n", form.solid);
    }
    Ok(text)
}

/// A character of a string of TOML.
fn escaped(c: char) -> Vec<char> {
    match c {
        '"' | '\\' => vec!['\\', c],
        _ if c.is_control() => format!("\\u{:04X}", u32::from(c)).chars().collect(),
        _ => vec![c],
    }
}

/// Loads a scene and says its warnings.
fn load(path: &Path) -> Result<scene::Loaded, Failure> {
    let loaded = scene::load(path, &LoadOptions::default()).map_err(Failure::input)?;
    for warning in &loaded.warnings {
        note(&format!("warning: {warning}"));
    }
    Ok(loaded)
}

/// Lines with a name at the left. What comes from a file is shown without control characters.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn add(&mut self, name: &str, value: impl Display) {
        let _ = writeln!(self.0, "{name:<14}  {}", printable(&value.to_string()));
    }
}

fn scene(path: &Path) -> Result<Lines, Failure> {
    let loaded = load(path)?;
    let mut lines = Lines::default();
    lines.add("scene", path.display());
    lines.add("materials", materials(&loaded.description));
    lines.add("textures", loaded.description.textures.len());
    lines.add("lights", lights(&loaded.description));
    let framed = if loaded.description.camera.is_none() { ", framed as the scene has none" } else { "" };
    let scene = Scene::new(loaded.description)
        .map_err(|error| Failure::Input(format!("{}: {error}; mend the scene", path.display())))?;
    lines.add("triangles", scene.triangle_count());
    lines.add("free forms", scene.form_count());
    let bounds = scene.bounds();
    lines.add("bounds", format!("{} to {}", vector(bounds.min), vector(bounds.max)));
    let camera = scene.camera();
    lines.add(
        "camera",
        format!(
            "eye {}, at {}, up {}, fov {}{framed}",
            vector(camera.eye),
            vector(camera.at),
            vector(camera.up),
            camera.fov_y_degrees
        ),
    );
    if let Some(size) = loaded.settings.size {
        lines.add("size", format!("{} x {}", size.x, size.y));
    }
    lines.add("memory", format!("{:.1} MB", scene.memory_bytes() as f64 / 1e6));
    Ok(lines)
}

/// The number of materials, and of each kind that there is.
fn materials(description: &Description) -> String {
    let kinds = ["diffuse", "glossy", "mirror", "glass"];
    let mut counts = [0_usize; 4];
    for material in &description.materials {
        counts[match material.specular {
            SpecularKind::None => 0,
            SpecularKind::Ggx { .. } => 1,
            SpecularKind::Mirror { .. } => 2,
            SpecularKind::Dielectric { .. } => 3,
        }] += 1;
    }
    counted(description.materials.len(), &kinds, &counts)
}

/// The number of lights, and of each kind that there is.
fn lights(description: &Description) -> String {
    let shines = |material: u32| description.materials.get(material as usize).is_some_and(|m| m.emission != Vec3::ZERO);
    let triangles =
        description.meshes.iter().flat_map(|mesh| &mesh.materials).filter(|material| shines(**material)).count();
    let forms = description.forms.iter().filter(|form| shines(form.material));
    let forms = forms.map(|form| form.copies.len().max(1)).sum();
    let points = description.lights.iter().filter(|light| matches!(light, PunctualLight::Point { .. })).count();
    let counts =
        [triangles, forms, points, description.lights.len() - points, usize::from(description.environment.is_some())];
    let kinds = ["triangles that shine", "free forms that shine", "points", "directional", "environment"];
    counted(counts.iter().sum(), &kinds, &counts)
}

fn counted(total: usize, kinds: &[&str], counts: &[usize]) -> String {
    let present = kinds.iter().zip(counts).filter(|(_, count)| **count > 0);
    let words: Vec<String> = present.map(|(kind, count)| format!("{count} {kind}")).collect();
    if words.is_empty() { total.to_string() } else { format!("{total}: {}", words.join(", ")) }
}

fn vector(v: Vec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

fn picture(path: &Path) -> Result<Lines, Failure> {
    let bytes = read_file(path).map_err(Failure::input)?;
    let mut lines = Lines::default();
    lines.add("picture", path.display());
    if PictureFormat::of(&bytes) == Some(PictureFormat::Exr) {
        let damaged =
            |error| Failure::Input(format!("{}: the EXR is damaged: {error}; get the file again", path.display()));
        let meta = MetaData::read_from_buffered(Cursor::new(&bytes), false).map_err(damaged)?;
        for (part, header) in meta.headers.iter().enumerate() {
            exr_part(&mut lines, part, header);
        }
        let mut names: Vec<(&Text, &AttributeValue)> = meta
            .headers
            .iter()
            .flat_map(|header| header.shared_attributes.other.iter().chain(&header.own_attributes.other))
            .collect();
        names.sort_by_key(|(name, _)| name.to_string());
        for (name, value) in names {
            if let AttributeValue::Text(text) = value {
                lines.add(&name.to_string(), text);
            }
        }
        if !meta.headers.iter().any(has_rgb) {
            return Ok(lines);
        }
    }
    let picture = Picture::decode(path, &bytes).map_err(Failure::input)?;
    lines.add("format", picture.format.name());
    lines.add("size", format!("{} x {}", picture.size.x, picture.size.y));
    let (mut least, mut most, mut sum, mut finite) = (Vec3::INFINITY, Vec3::NEG_INFINITY, DVec3::ZERO, 0_usize);
    for pixel in picture.pixels.iter().filter(|pixel| pixel.is_finite()) {
        least = least.min(*pixel);
        most = most.max(*pixel);
        sum += pixel.as_dvec3();
        finite += 1;
    }
    if finite > 0 {
        lines.add("least", vector(least));
        lines.add("mean", vector((sum / finite as f64).as_vec3()));
        lines.add("most", vector(most));
    }
    lines.add("not finite", format!("{} pixels", picture.pixels.len() - finite));
    Ok(lines)
}

/// Whether a part is a picture in colours.
fn has_rgb(header: &Header) -> bool {
    !header.deep && ["R", "G", "B"].iter().all(|&name| header.channels.list.iter().any(|channel| channel.name.eq(name)))
}

/// The header of one part.
fn exr_part(lines: &mut Lines, part: usize, header: &Header) {
    const SHOWN: usize = 100;
    let names: Vec<String> = header.channels.list.iter().take(SHOWN).map(|channel| channel.name.to_string()).collect();
    let more = if header.channels.list.len() > SHOWN { " ..." } else { "" };
    lines.add(
        &format!("part {part}"),
        format!(
            "{} x {}, {}{}",
            header.layer_size.width(),
            header.layer_size.height(),
            header.compression,
            if header.deep { ", deep" } else { "" }
        ),
    );
    lines.add("channels", format!("{}{more}", names.join(" ")));
    if let Some(software) = &header.own_attributes.software_name {
        lines.add("software", software);
    }
}
