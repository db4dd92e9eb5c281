//! `freelux mesh`: the free forms of a scene as an OBJ file, for other tools.

use std::path::PathBuf;
use std::process::ExitCode;

use scene::LoadOptions;

use crate::args;
use crate::failure::{Failure, note};
use crate::files;

/// Write the free forms of a scene as closed meshes in an OBJ file.
#[derive(Debug, clap::Args)]
pub(crate) struct MeshArgs {
    /// Scene (.toml)
    scene: PathBuf,
    /// Sides of the cubes that the surface is cut into, metres
    #[arg(long, value_name = "SIZE", value_parser = args::finite)]
    cell: f32,
    /// OBJ file to write
    #[arg(long, value_name = "FILE.obj")]
    out: PathBuf,
}

/// Reads the scene, makes a mesh of each form, and writes the file.
pub(crate) fn run(args: &MeshArgs) -> Result<ExitCode, Failure> {
    let suffix = args.out.extension().and_then(|suffix| suffix.to_str());
    if !suffix.is_some_and(|suffix| suffix.eq_ignore_ascii_case("obj")) {
        return Err(Failure::Input(format!("{}: its suffix must be .obj", args.out.display())));
    }
    files::check_writable(&args.out)?;
    let loaded = scene::load(&args.scene, &LoadOptions::default()).map_err(Failure::input)?;
    for warning in &loaded.warnings {
        note(&format!("warning: {warning}"));
    }
    let description = &loaded.description;
    if description.forms.is_empty() {
        return Err(Failure::Input(format!("{}: no free forms; its meshes need no other file", args.scene.display())));
    }
    let (mut obj, mut vertices, mut triangles, mut bodies) = (Vec::new(), 0, 0, 0);
    for (index, form) in description.forms.iter().enumerate() {
        let name: String =
            if form.name.is_empty() { format!("form_{index}") } else { form.name.replace(char::is_whitespace, "_") };
        let mesh = form.solid.to_mesh(f64::from(args.cell)).map_err(|error| {
            Failure::Input(format!("{}: form {index} \"{}\": {error}", args.scene.display(), form.name))
        })?;
        let alone = form.copies.is_empty().then(|| mesh.clone());
        for (copy, mesh) in alone.into_iter().chain(form.copies.iter().map(|copy| mesh.transformed(copy))).enumerate() {
            let name = if form.copies.is_empty() { name.clone() } else { format!("{name}_{copy}") };
            let written = mesh.write_obj(&name, vertices, &mut obj);
            written.map_err(|error| Failure::unwritable(&args.out, &error))?;
            vertices += mesh.positions.len();
            triangles += mesh.triangles.len();
            bodies += 1;
        }
    }
    files::write_all(&[(&args.out, obj)])?;
    note(&format!("{}: {bodies} forms, {vertices} vertices, {triangles} triangles", args.out.display(),));
    Ok(ExitCode::SUCCESS)
}
