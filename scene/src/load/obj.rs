//! OBJ meshes, read by tobj.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::error::{LoadError, Place};
use super::files::Files;
use super::limits;
use super::lines::Lines;
use super::obj_reader::{Face, ObjReader};
use super::polygon::Cutter;
use super::warnings::Warnings;
use crate::bounds::Aabb;
use crate::description::{Mesh, NO_INDEX};

/// An OBJ file: a mesh whose `materials` point into `names`.
#[derive(Debug, Clone)]
pub(super) struct Obj {
    pub(super) mesh: Mesh,
    /// Names after `usemtl`; the first, empty, stands for faces before any.
    pub(super) names: Vec<String>,
    /// Arguments of `mtllib`, each with its line.
    pub(super) libraries: Vec<(String, usize)>,
}

/// Reads the OBJ file `path`, which was named at `place`.
pub(super) fn read(
    files: Files<'_>,
    path: &Path,
    place: Place<'_>,
    cutter: &mut Cutter,
    warnings: &mut Warnings,
) -> Result<Obj, LoadError> {
    let (file, _) = files.open(path, place, limits::FILE_BYTES)?;
    let mut reader = ObjReader::new(Lines::new(path, file));
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let read = tobj::load_obj_buf(&mut reader, &options, |_| Ok(Default::default()));
    if let Some(error) = reader.error.take() {
        return Err(error);
    }
    reader.check_indices()?;
    let (mut models, _) = read.map_err(|error| reader.place().invalid(error.to_string(), "correct the line"))?;
    let file = Place::file(path);
    let skipped = "faces of fewer than three corners, points or lines left out";
    warnings.add_times(format!("{file}: {skipped}"), reader.skipped);
    warnings.add_times(format!("{file}: lines of curves, surfaces or unknown keywords left out"), reader.unknown);
    // Groups and materials are kept from tobj, so all faces are in one model.
    let source = models.pop().map(|model| model.mesh).unwrap_or_default();
    let mesh = assemble(source, &reader.faces, path, cutter, warnings)?;
    Ok(Obj { mesh, names: reader.names, libraries: reader.libraries })
}

/// Splits the polygons and keeps normals and texture coordinates only where the file gives them.
fn assemble(
    source: tobj::Mesh,
    faces: &[Face],
    path: &Path,
    cutter: &mut Cutter,
    warnings: &mut Warnings,
) -> Result<Mesh, LoadError> {
    let file = Place::file(path);
    let mut mesh = Mesh {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        positions: source.positions.chunks_exact(3).map(Vec3::from_slice).collect(),
        normals: source
            .normals
            .chunks_exact(3)
            .map(|n| Vec3::from_slice(n).as_dvec3().normalize_or_zero().as_vec3())
            .collect(),
        uvs: source.texcoords.chunks_exact(2).map(Vec2::from_slice).collect(),
        ..Mesh::default()
    };
    let with_normals = faces.iter().any(|face| face.has_normals) && !mesh.normals.is_empty();
    let with_uvs = faces.iter().any(|face| face.has_uvs);
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    let (mut start, mut flat, mut empty) = (0, 0, 0);
    for (i, face) in faces.iter().enumerate() {
        let arity = source.face_arities.get(i).map_or(3, |&arity| arity as usize);
        let range = start..start + arity;
        start = range.end;
        let indices = &source.indices[range.clone()];
        corners.clear();
        corners.extend(indices.iter().map(|&index| mesh.positions[index as usize]));
        triangles.clear();
        let place = Place::line(path, face.line as usize);
        empty += usize::from(!cutter.cut(&corners, &mut triangles, place)?);
        let normals = (face.has_normals && with_normals).then(|| &source.normal_indices[range.clone()]);
        let normals = normals.filter(|indices| indices.iter().all(|&index| mesh.normals[index as usize] != Vec3::ZERO));
        flat += usize::from(face.has_normals && normals.is_none());
        let uvs = face.has_uvs.then(|| &source.texcoord_indices[range]);
        let pick = |indices: &[u32], triangle: &[u32; 3]| triangle.map(|corner| indices[corner as usize]);
        for triangle in &triangles {
            mesh.triangles.push(pick(indices, triangle));
            mesh.materials.push(face.material);
            if with_normals {
                mesh.normal_indices.push(normals.map_or([NO_INDEX; 3], |indices| pick(indices, triangle)));
            }
            if with_uvs {
                mesh.uv_indices.push(uvs.map_or([NO_INDEX; 3], |indices| pick(indices, triangle)));
            }
        }
    }
    warnings.add_times(format!("{file}: faces with missing normals or normals of length zero taken as flat"), flat);
    warnings.add_times(format!("{file}: polygons without area left out"), empty);
    if let Some(rounding) = coarse_rounding(&mesh) {
        warnings.add(format!("{file}: so far from the origin that places are rounded to {rounding} m; move it nearer"));
    }
    // No face uses them any longer, and a scene has no normals of length zero.
    mesh.normals.iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
    if faces.is_empty() {
        return Err(file.invalid("no faces", "give a file with polygons ('f' lines)"));
    }
    if !has_area(&mesh) {
        return Err(file.invalid("nothing to see, all faces are of zero area", "check the coordinates"));
    }
    Ok(mesh)
}

/// Returns to how many metres places are rounded, where the mesh is so far from the origin that its triangles suffer.
fn coarse_rounding(mesh: &Mesh) -> Option<f32> {
    /// Sizes of the mesh: nearer ones are no farther than it has to be.
    const FAR: f32 = 4.0;
    /// Share of a usual side.
    const COARSE: f64 = 0.01;
    let bounds = Aabb::of_points(&mesh.positions);
    let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
    if farthest < FAR * bounds.radius() {
        return None;
    }
    let rounding = farthest.next_up() - farthest;
    let longest_sq = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
        a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a))
    };
    let sides = mesh.triangles.iter().map(longest_sq).filter(|&square| square > 0.0);
    let (logarithms, count) = sides.fold((0.0, 0.0), |(sum, count), square| (sum + 0.5 * square.ln(), count + 1.0));
    (f64::from(rounding) > COARSE * (logarithms / count).exp()).then_some(rounding)
}

/// Whether any triangle has an area.
pub(super) fn has_area(mesh: &Mesh) -> bool {
    mesh.triangles.iter().any(|triangle| {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
        (b - a).cross(c - a).length_squared() > 0.0
    })
}
