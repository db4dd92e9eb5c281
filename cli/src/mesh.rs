//! `freelux mesh`: the free forms of a scene as an OBJ file, for other tools.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use scene::freeform::{Bounds, SurfaceMesh};
use scene::{Description, FormObject, LoadOptions, limits};

use crate::args;
use crate::failure::{Failure, note};
use crate::files::{self, Staged};

/// Write the free forms of a scene as closed meshes in an OBJ file.
#[derive(Debug, clap::Args)]
pub(crate) struct MeshArgs {
    /// Scene (.toml)
    scene: PathBuf,
    /// Sides of the cubes that the surface is cut into, metres
    #[arg(long, value_name = "SIZE", value_parser = args::positive, allow_hyphen_values = true)]
    cell: f32,
    /// OBJ file to write
    #[arg(long, short, value_name = "FILE.obj")]
    out: PathBuf,
    /// Only the forms of this name, or of this number in the order of the file, from 0; may be given again
    #[arg(long = "form", value_name = "NAME|NUMBER")]
    forms: Vec<String>,
    /// One of each form, without its copies
    #[arg(long)]
    once: bool,
}

/// Reads the scene, makes a mesh of each form, and writes the file.
pub(crate) fn run(args: &MeshArgs) -> Result<ExitCode, Failure> {
    let suffix = args.out.extension().and_then(|suffix| suffix.to_str());
    if !suffix.is_some_and(|suffix| suffix.eq_ignore_ascii_case("obj")) {
        return Err(Failure::Input(format!("{}: its suffix must be .obj", args.out.display())));
    }
    files::check_writable(&args.out)?;
    files::check_apart(&[&args.out], &[args.scene.as_path()])?;
    files::await_files(&[&args.out]);
    let loaded = scene::load(&args.scene, &LoadOptions::default()).map_err(Failure::input)?;
    files::check_apart(&[&args.out], &loaded.files)?;
    for warning in &loaded.warnings {
        note(&format!("warning: {warning}"));
    }
    let description = &loaded.description;
    let mut meshes = Vec::new();
    for (index, form) in chosen(description, args)? {
        let refused =
            |why: String| Failure::Input(format!("{}: form {index} \"{}\": {why}", args.scene.display(), form.name));
        let mesh = form.solid.to_mesh(f64::from(args.cell)).map_err(|error| refused(error.to_string()))?;
        if mesh.triangles.is_empty() {
            return Err(refused(
                "no corner of a cell is inside; take a smaller cell, or choose others by --form".into(),
            ));
        }
        let name =
            if form.name.is_empty() { format!("form_{index}") } else { form.name.replace(char::is_whitespace, "_") };
        let copies: &[_] = if args.once { &[] } else { &form.copies };
        meshes.push((name, with_texture_coordinates(mesh, form, description), copies));
    }
    let triangles: usize = meshes.iter().map(|(_, mesh, copies)| copies.len().max(1) * mesh.triangles.len()).sum();
    if triangles > limits::TRIANGLES {
        return Err(Failure::Input(format!(
            "{}: {triangles} triangles with all copies, more than the limit of {}; take a larger cell, or --once",
            args.scene.display(),
            limits::TRIANGLES
        )));
    }
    let (mut before, mut bodies) = ([0, 0], 0);
    let mut staged = Staged::default();
    staged.add(&args.out, |mut out| {
        let mut write = |name: &str, mesh: &SurfaceMesh| -> io::Result<()> {
            mesh.write_obj(name, before, &mut out)?;
            before = [before[0] + mesh.positions.len(), before[1] + mesh.uvs.len()];
            bodies += 1;
            Ok(())
        };
        for (name, mesh, copies) in &meshes {
            if copies.is_empty() {
                write(name, mesh)?;
            }
            // One at a time: a million of them need not fit into memory.
            for (number, copy) in copies.iter().enumerate() {
                write(&format!("{name}_{number}"), &mesh.transformed(copy))?;
            }
        }
        Ok(())
    })?;
    staged.finish()?;
    note(&format!("{}: {bodies} forms, {} vertices, {triangles} triangles", args.out.display(), before[0]));
    Ok(ExitCode::SUCCESS)
}

/// The forms that were asked for, with their numbers. Without names that is all that have bounds.
fn chosen<'a>(description: &'a Description, args: &MeshArgs) -> Result<Vec<(usize, &'a FormObject)>, Failure> {
    let forms = || description.forms.iter().enumerate();
    let refused = |why: String| Failure::Input(format!("{}: {why}", args.scene.display()));
    if description.forms.is_empty() {
        return Err(refused("no free forms; its meshes need no other file".into()));
    }
    let is_asked = |word: &str, (index, form): (usize, &FormObject)| form.name == word || index.to_string() == word;
    if let Some(unknown) = args.forms.iter().find(|word| !forms().any(|form| is_asked(word, form))) {
        return Err(refused(format!(
            "no form \"{unknown}\"; give a name, or a number below {}",
            description.forms.len()
        )));
    }
    if !args.forms.is_empty() {
        return Ok(forms().filter(|form| args.forms.iter().any(|word| is_asked(word, *form))).collect());
    }
    let (bounded, endless): (Vec<_>, Vec<_>) =
        forms().partition(|(_, form)| !matches!(form.solid.bounds(), Bounds::Unbounded));
    if bounded.is_empty() {
        return Err(refused("no form has bounds; clip one".into()));
    }
    for (index, form) in endless {
        note(&format!("warning: form {index} \"{}\" has no bounds and is left out", form.name));
    }
    Ok(bounded)
}

/// Gives a mesh the coordinates that the form has, if a picture is laid on it.
fn with_texture_coordinates(mesh: SurfaceMesh, form: &FormObject, description: &Description) -> SurfaceMesh {
    if description.materials[form.material as usize].textures().next().is_none() {
        return mesh;
    }
    match &form.projection {
        None => mesh.with_texture_coordinates(true, |p, _| form.solid.texture_coordinates(p)),
        Some(projection) => mesh.with_texture_coordinates(projection.runs_round(), projection.coordinates()),
    }
}
