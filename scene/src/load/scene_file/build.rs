//! From the tables of scene files to a description.

use std::collections::HashMap;

use freeform::Bounds;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use toml::Spanned;

use super::schema::{
    CameraTable, EnvironmentTable, FormTable, LightTable, MaterialTable, MeshTable, NoiseTable, PatternName,
};
use super::values::{Angles, Point, Scale};
use super::{Source, forms, repeat};
use crate::camera::DEFAULT_FOV;
use crate::description::{FormObject, Material, Mesh, PunctualLight, SpecularKind};
use crate::load::error::{LoadError, Place, nearest, quoted};
use crate::load::files::check_name;
use crate::load::loader::{Loader, Use, scaled};
use crate::load::{FileSettings, limits, obj};
use crate::{Camera, Noise, Pattern};

/// Indices of materials by name.
type Names<'a> = HashMap<&'a str, u32>;

/// Adds all that `sources` hold; of what there can be only one, the first file that has it wins.
pub(super) fn build(loader: &mut Loader<'_>, sources: &[Source]) -> Result<FileSettings, LoadError> {
    let mut names = Names::new();
    for source in sources {
        for table in &source.scene.material {
            let place = source.place(table.name.span());
            check_name(table.name.as_ref(), place)?;
            let material = material(loader, table, source)?;
            let index = loader.add_material(material, place)?;
            if names.insert(table.name.as_ref(), index).is_some() {
                return Err(place.invalid(format!("two materials {}", quoted(table.name.as_ref())), "rename one"));
            }
        }
    }
    let mut meshes = Vec::new();
    for source in sources {
        for table in &source.scene.mesh {
            meshes.push((add_mesh(loader, table, &names, source)?, table, source));
        }
        for table in &source.scene.form {
            let form = form(loader, table, &names, source)?;
            loader.description.forms.push(form);
        }
        loader.description.lights.extend(source.scene.light.iter().map(light));
    }
    for (index, table, source) in meshes {
        name_and_move(&mut loader.description.meshes[index], table, source)?;
    }
    let root = Place::file(&sources[0].path);
    if loader.description.meshes.is_empty() && loader.description.forms.is_empty() {
        return Err(root.invalid("nothing to see", "add a [[mesh]] or a [[form]]"));
    }
    if let Some((source, table)) = first(sources, |source| source.scene.camera.as_ref()) {
        loader.description.camera = Some(camera(table, source)?);
    }
    if let Some((source, table)) = first(sources, |source| source.scene.environment.as_ref()) {
        let environment = environment(loader, table, source)?;
        loader.description.environment = Some(environment);
    }
    let film = first(sources, |source| source.scene.film.as_ref()).map(|(_, film)| film);
    let render = first(sources, |source| source.scene.render.as_ref()).map(|(_, render)| render);
    Ok(FileSettings {
        size: film.and_then(|film| film.size).map(|size| size.0),
        exposure: film.and_then(|film| film.exposure).map(|exposure| exposure.0),
        quality: render.and_then(|render| render.quality).map(|quality| quality.0),
        spp: render.and_then(|render| render.spp).map(|spp| spp.0),
        seed: render.and_then(|render| render.seed),
    })
}

/// The first of `sources` that has something, with it.
fn first<'a, T>(sources: &'a [Source], part: impl Fn(&'a Source) -> Option<T>) -> Option<(&'a Source, T)> {
    sources.iter().find_map(|source| part(source).map(|part| (source, part)))
}

fn camera(table: &Spanned<CameraTable>, source: &Source) -> Result<Camera, LoadError> {
    let place = source.place(table.span());
    let CameraTable { eye, at, up, fov } = table.get_ref();
    let camera = Camera {
        eye: eye.0.as_vec3(),
        at: at.0.as_vec3(),
        up: up.map_or(Vec3::Y, |up| up.0.as_vec3()),
        fov_y_degrees: fov.map_or(DEFAULT_FOV, |fov| fov.0),
    };
    let Some(forward) = camera.forward() else {
        return Err(place.invalid("eye and at are the same point", "move one of them"));
    };
    if !camera.is_upright(forward) {
        return Err(place.invalid("up is parallel to the view", "give another up, such as up = [0, 0, -1]"));
    }
    Ok(camera)
}

fn environment(
    loader: &mut Loader<'_>,
    table: &Spanned<EnvironmentTable>,
    source: &Source,
) -> Result<crate::Environment, LoadError> {
    let EnvironmentTable { file, scale, radiance } = table.get_ref();
    let environment = match (file, radiance) {
        (Some(file), None) => {
            check_name(file.as_ref(), source.place(file.span()))?;
            let path = loader.files.resolve(&source.path, file.as_ref());
            loader.environment(loader.files, &path, source.place(file.span()))?
        }
        (None, Some(radiance)) => crate::Environment::constant(radiance.0),
        _ => {
            return Err(source
                .place(table.span())
                .invalid("an environment needs either file or radiance", "write one of them"));
        }
    };
    scaled(environment, scale.map_or(1.0, |scale| scale.0), source.place(table.span()))
}

fn light(table: &LightTable) -> PunctualLight {
    match *table {
        LightTable::Point { position, intensity } => {
            PunctualLight::Point { position: position.0.as_vec3(), intensity: intensity.0 }
        }
        LightTable::Directional { direction, irradiance } => {
            PunctualLight::Directional { direction: direction.0.as_vec3(), irradiance: irradiance.0 }
        }
    }
}

fn material(loader: &mut Loader<'_>, table: &MaterialTable, source: &Source) -> Result<Material, LoadError> {
    let mut texture = |name: &Option<Spanned<String>>, usage| {
        name.as_ref()
            .map(|name| {
                let place = source.place(name.span());
                check_name(name.as_ref(), place)?;
                let path = loader.files.resolve(&source.path, name.as_ref());
                loader.texture(&path, usage, place)
            })
            .transpose()
    };
    let specular = match (&table.gloss, &table.mirror, &table.glass) {
        (None, None, None) => SpecularKind::None,
        (Some(gloss), None, None) => {
            SpecularKind::Ggx { alpha: gloss.alpha.0, reflectance: gloss.reflectance.0, schlick: gloss.schlick }
        }
        (None, Some(mirror), None) => SpecularKind::Mirror { reflectance: mirror.reflectance.0 },
        (None, None, Some(glass)) => SpecularKind::Dielectric {
            ior: glass.ior.0,
            tint: glass.tint.map_or(Vec3::ONE, |tint| tint.0),
            absorption: glass.absorption.map_or(Vec3::ZERO, |absorption| absorption.0),
            priority: glass.priority,
        },
        _ => {
            let what = format!("material {} has more than one of gloss, mirror and glass", quoted(table.name.as_ref()));
            return Err(source.place(table.name.span()).invalid(what, "keep one"));
        }
    };
    if let (Some(name), SpecularKind::None | SpecularKind::Dielectric { .. }) = (&table.specular_texture, specular) {
        let what = "a specular_texture without gloss or mirror";
        return Err(source.place(name.span()).invalid(what, "add one of them, or remove the texture"));
    }
    // What is textured is the texture; what shines or reflects needs no grey beneath.
    let is_textured = table.diffuse_texture.is_some() || table.noise.is_some();
    let shines = table.emission.is_some() || table.emission_texture.is_some();
    let unsaid = match (is_textured, specular, shines) {
        (true, _, _) => 1.0,
        (false, SpecularKind::None, false) => 0.5,
        _ => 0.0,
    };
    Ok(Material {
        name: table.name.get_ref().clone(),
        diffuse: table.diffuse.map_or(Vec3::splat(unsaid), |diffuse| diffuse.0),
        diffuse_texture: texture(&table.diffuse_texture, Use::Color)?,
        noise: table.noise.as_ref().map(|table| noise(table, source)).transpose()?,
        specular,
        specular_texture: texture(&table.specular_texture, Use::Color)?,
        emission: match (table.emission, &table.emission_texture) {
            (Some(emission), _) => emission.0,
            (None, Some(_)) => Vec3::ONE,
            (None, None) => Vec3::ZERO,
        },
        emission_texture: texture(&table.emission_texture, Use::Emission)?,
        opacity: table.opacity.map_or(1.0, |opacity| opacity.0),
        opacity_texture: texture(&table.opacity_texture, Use::Mask)?,
    })
}

fn noise(table: &Spanned<NoiseTable>, source: &Source) -> Result<Noise, LoadError> {
    let NoiseTable { pattern, size, octaves, distortion, low, high, seed } = *table.get_ref();
    if pattern == PatternName::Clouds && distortion.is_some() {
        return Err(source
            .place(table.span())
            .invalid("clouds with a distortion", "remove it, or choose marble or wood"));
    }
    let pattern = match pattern {
        PatternName::Clouds => Pattern::Clouds,
        PatternName::Marble => Pattern::Marble,
        PatternName::Wood => Pattern::Wood,
    };
    Ok(Noise {
        pattern,
        size: size.0,
        octaves: octaves.map_or(4, |octaves| octaves.0),
        distortion: distortion.map_or(1.0, |distortion| distortion.0),
        low: low.map_or(Vec3::ZERO, |low| low.0),
        high: high.map_or(Vec3::ONE, |high| high.0),
        seed,
    })
}

/// The index of a material by name.
fn named(name: &Spanned<String>, names: &Names<'_>, source: &Source) -> Result<u32, LoadError> {
    names.get(name.as_ref().as_str()).copied().ok_or_else(|| {
        let advice = match nearest(name.as_ref(), names.keys().copied()) {
            Some(close) => format!("write {}", quoted(close)),
            None => "add a [[material]] of that name".to_owned(),
        };
        source.place(name.span()).invalid(format!("no material {}", quoted(name.as_ref())), advice)
    })
}

fn form(
    loader: &mut Loader<'_>,
    table: &Spanned<FormTable>,
    names: &Names<'_>,
    source: &Source,
) -> Result<FormObject, LoadError> {
    let place = source.place(table.span());
    let FormTable { name, material, repeat, translate, .. } = table.get_ref();
    check_name(name, place)?;
    let solid = forms::solid(table, source)?;
    let projection = forms::projection(table.get_ref(), source)?;
    let material = match material {
        Some(name) => named(name, names, source)?,
        None => loader.default_material(place)?,
    };
    let shines = loader.description.materials[material as usize].is_emissive();
    match solid.bounds() {
        Bounds::Unbounded if shines => {
            let advice = "bound it, or give it a material without emission";
            return Err(place.invalid("an unbounded form that shines", advice));
        }
        Bounds::Finite { min, max } if min.cmpge(max).any() => {
            return Err(place.invalid("a form without inside", "let its parts meet, or remove it"));
        }
        Bounds::Finite { min, max } if min.abs().max(max.abs()).max_element() > limits::COORDINATE => {
            let what = format!("a form that reaches beyond the limit of {:e} metres", limits::COORDINATE);
            return Err(place.invalid(what, "make it smaller or clip it"));
        }
        _ => {}
    }
    let center = translate.map_or(DVec3::ZERO, |point| point.0);
    let copies = repeat.as_ref().map(|table| repeat::copies(table, &solid, center, source, loader)).transpose()?;
    Ok(FormObject { name: name.clone(), solid, material, projection, copies: copies.unwrap_or_default() })
}

/// Adds a mesh as its file or its faces say; returns its index.
fn add_mesh(
    loader: &mut Loader<'_>,
    table: &Spanned<MeshTable>,
    names: &Names<'_>,
    source: &Source,
) -> Result<usize, LoadError> {
    let place = source.place(table.span());
    let MeshTable { name, material, file, positions, normals, uvs, faces, .. } = table.get_ref();
    check_name(name, place)?;
    let material = material.as_ref().map(|name| named(name, names, source)).transpose()?;
    match file {
        Some(file) => {
            if !(positions.is_empty() && normals.is_empty() && uvs.is_empty() && faces.is_empty()) {
                return Err(place.invalid("a mesh with a file and faces of its own", "keep one"));
            }
            check_name(file.as_ref(), source.place(file.span()))?;
            let path = loader.files.resolve(&source.path, file.as_ref());
            loader.add_obj(&path, material, source.place(file.span()))
        }
        None => {
            let material = material.map_or_else(|| loader.default_material(place), Ok)?;
            let mesh = inline_mesh(loader, table, material, source)?;
            loader.add_mesh(mesh, place)
        }
    }
}

/// Gives a mesh the name that its table says, and moves it to its place.
fn name_and_move(mesh: &mut Mesh, table: &Spanned<MeshTable>, source: &Source) -> Result<(), LoadError> {
    let MeshTable { name, scale, rotate, translate, .. } = table.get_ref();
    if !name.is_empty() {
        mesh.name.clone_from(name);
    }
    if let Some(transform) = transformation(*scale, *rotate, *translate) {
        move_mesh(mesh, &transform);
        if mesh.positions.iter().any(|p| f64::from(p.abs().max_element()) > limits::COORDINATE) {
            let what = format!("scaled beyond the limit of {:e} metres", limits::COORDINATE);
            return Err(source.place(table.span()).invalid(what, "scale it less"));
        }
        if !obj::has_area(mesh) {
            let what = "nothing to see, all faces are rounded to zero area where they are moved to";
            return Err(source.place(table.span()).invalid(what, "move it less far, or scale it less down"));
        }
    }
    Ok(())
}

/// A mesh whose positions and faces are in the scene file; indices count from 0 and serve normals and uvs too.
fn inline_mesh(
    loader: &mut Loader<'_>,
    table: &Spanned<MeshTable>,
    material: u32,
    source: &Source,
) -> Result<Mesh, LoadError> {
    let place = source.place(table.span());
    let MeshTable { name, positions, normals, uvs, faces, .. } = table.get_ref();
    if positions.is_empty() || faces.is_empty() {
        return Err(place.invalid("a mesh without positions or faces", "give both, or a file"));
    }
    for (count, what) in [(normals.len(), "normals"), (uvs.len(), "uvs")] {
        if count != 0 && count != positions.len() {
            let what = format!("{count} {what} for {} positions", positions.len());
            return Err(place.invalid(what, "give one for each position, or none"));
        }
    }
    let mut mesh = Mesh {
        name: name.clone(),
        positions: positions.iter().map(|p| p.0.as_vec3()).collect(),
        normals: normals.iter().map(|n| n.0.as_vec3()).collect(),
        uvs: uvs.iter().map(|uv| uv.0).collect(),
        ..Mesh::default()
    };
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for face in faces {
        let (face, place) = (face.get_ref(), source.place(face.span()));
        if let Some(index) = face.iter().find(|&&index| index as usize >= positions.len()) {
            let what = format!("face index {index} is out of range, there are {} positions", positions.len());
            return Err(place.invalid(what, "indices count from 0"));
        }
        corners.clear();
        corners.extend(face.iter().map(|&index| mesh.positions[index as usize]));
        if face.len() < 3 {
            return Err(place.invalid(format!("a face of {} corners", face.len()), "give three or more"));
        }
        triangles.clear();
        loader.cutter.cut(&corners, &mut triangles, place)?;
        mesh.triangles.extend(triangles.iter().map(|triangle| triangle.map(|corner| face[corner as usize])));
    }
    if !normals.is_empty() {
        mesh.normal_indices.clone_from(&mesh.triangles);
    }
    if !uvs.is_empty() {
        mesh.uv_indices.clone_from(&mesh.triangles);
    }
    mesh.materials = vec![material; mesh.triangles.len()];
    if !obj::has_area(&mesh) {
        return Err(place.invalid("nothing to see of this mesh, all faces are of zero area", "check its positions"));
    }
    Ok(mesh)
}

/// Scale, then rotations about x, y and z, then translation; `None` where nothing is asked.
pub(super) fn transformation(
    scale: Option<Scale>,
    rotate: Option<Angles>,
    translate: Option<Point>,
) -> Option<DAffine3> {
    if scale.is_none() && rotate.is_none() && translate.is_none() {
        return None;
    }
    let mut matrix = DMat3::from_diagonal(scale.map_or(DVec3::ONE, |scale| scale.0));
    if let Some(Angles(degrees)) = rotate {
        let angle = degrees.map(f64::to_radians);
        matrix = DMat3::from_rotation_z(angle.z)
            * DMat3::from_rotation_y(angle.y)
            * DMat3::from_rotation_x(angle.x)
            * matrix;
    }
    Some(DAffine3::from_mat3_translation(matrix, translate.map_or(DVec3::ZERO, |point| point.0)))
}

/// Moves a mesh; a mirrored one keeps its front outside.
fn move_mesh(mesh: &mut Mesh, transform: &DAffine3) {
    for p in &mut mesh.positions {
        *p = transform.transform_point3(p.as_dvec3()).as_vec3();
    }
    let normal_matrix = transform.matrix3.inverse().transpose();
    for n in &mut mesh.normals {
        *n = (normal_matrix * n.as_dvec3()).normalize_or_zero().as_vec3();
    }
    if transform.matrix3.determinant() < 0.0 {
        for triangles in [&mut mesh.triangles, &mut mesh.normal_indices, &mut mesh.uv_indices] {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }
}
