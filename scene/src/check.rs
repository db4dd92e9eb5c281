//! Checks every number and index of a description once, so that nothing else has to.

use freeform::Bounds;
use glam::{DAffine3, DVec3, Vec2, Vec3};

use crate::description::NO_INDEX;
use crate::media::MediumTable;
use crate::{
    BuildError, Description, Environment, FormObject, Material, Mesh, Noise, PunctualLight, SpecularKind, Texture,
};

/// Triangles, free forms, and vertices of each kind, at most: each for itself, so that primitives are numbered in less
/// than 32 bits.
pub(crate) const MAX_PRIMITIVES: usize = 1 << 28;
const MAX_MATERIALS: usize = 65_536;
/// Farther coordinates would overflow f32 in the triangle test, whose products are of the third degree.
const MAX_COORDINATE: f32 = 1e12;

pub(crate) fn check(description: &Description) -> Result<(), BuildError> {
    let counts = [
        ("triangles", description.meshes.iter().map(|m| m.triangles.len()).sum(), MAX_PRIMITIVES),
        ("positions", description.meshes.iter().map(|m| m.positions.len()).sum(), MAX_PRIMITIVES),
        ("normals", description.meshes.iter().map(|m| m.normals.len()).sum(), MAX_PRIMITIVES),
        ("texture coordinates", description.meshes.iter().map(|m| m.uvs.len()).sum(), MAX_PRIMITIVES),
        ("free forms", description.forms.iter().map(|form| form.copies.len().max(1)).sum(), MAX_PRIMITIVES),
        ("materials", description.materials.len(), MAX_MATERIALS),
    ];
    for (what, count, limit) in counts {
        if count > limit {
            return Err(BuildError::TooMany { what, count, limit });
        }
    }
    for mesh in &description.meshes {
        check_mesh(mesh, description.materials.len())?;
    }
    for (index, form) in description.forms.iter().enumerate() {
        check_form(index, form, description.materials.len())?;
    }
    for (index, material) in description.materials.iter().enumerate() {
        check_material(index, material, &description.textures)?;
    }
    check_media(&description.materials)?;
    // Emission alone may be above 1.
    let mut most = vec![1.0; description.textures.len()];
    for texture in description.materials.iter().filter_map(|material| material.emission_texture) {
        most[texture as usize] = f32::MAX;
    }
    for texture in
        description.materials.iter().flat_map(|m| [m.diffuse_texture, m.specular_texture, m.opacity_texture]).flatten()
    {
        most[texture as usize] = 1.0;
    }
    for (index, (texture, &most)) in description.textures.iter().zip(&most).enumerate() {
        check_texture(index, texture, most)?;
    }
    for (index, light) in description.lights.iter().enumerate() {
        check_light(index, light)?;
    }
    description.environment.as_ref().map_or(Ok(()), check_environment)?;
    description.camera.as_ref().map_or(Ok(()), check_camera)
}

fn check_mesh(mesh: &Mesh, materials: usize) -> Result<(), BuildError> {
    let vertex = |kind, index, what| Err(BuildError::Vertex { mesh: mesh.name.clone(), kind, index, what });
    if let Some(index) = mesh.positions.iter().position(|p| !(p.abs().max_element() <= MAX_COORDINATE && p.is_finite()))
    {
        return vertex("position", index, "is not finite or beyond 1e12");
    }
    if let Some(index) = mesh.normals.iter().position(|n| n.try_normalize().is_none()) {
        return vertex("normal", index, "is not finite or of length 0");
    }
    if let Some(index) = mesh.uvs.iter().position(|uv| !Vec2::is_finite(*uv)) {
        return vertex("texture coordinate", index, "is not finite");
    }
    let count = mesh.triangles.len();
    let whole = |what| Err(BuildError::Mesh { mesh: mesh.name.clone(), what });
    if mesh.materials.len() != count {
        return whole("the number of materials is not that of triangles");
    }
    if !(mesh.normal_indices.is_empty() || mesh.normal_indices.len() == count) {
        return whole("the number of normal indices is not that of triangles");
    }
    if !(mesh.uv_indices.is_empty() || mesh.uv_indices.len() == count) {
        return whole("the number of texture indices is not that of triangles");
    }
    check_indices(mesh, "position", &mesh.triangles, mesh.positions.len(), false)?;
    check_indices(mesh, "normal", &mesh.normal_indices, mesh.normals.len(), true)?;
    check_indices(mesh, "texture", &mesh.uv_indices, mesh.uvs.len(), true)?;
    if let Some(triangle) = mesh.materials.iter().position(|&m| m as usize >= materials) {
        let what = format!("material {} of {materials}", mesh.materials[triangle]);
        return Err(BuildError::Triangle { mesh: mesh.name.clone(), triangle, what });
    }
    Ok(())
}

fn check_indices(
    mesh: &Mesh,
    kind: &str,
    indices: &[[u32; 3]],
    count: usize,
    optional: bool,
) -> Result<(), BuildError> {
    let wrong = |&i: &u32| i as usize >= count && !(optional && i == NO_INDEX);
    match indices
        .iter()
        .enumerate()
        .find_map(|(triangle, corners)| corners.iter().copied().find(wrong).map(|i| (triangle, i)))
    {
        Some((triangle, i)) => {
            Err(BuildError::Triangle { mesh: mesh.name.clone(), triangle, what: format!("{kind} {i} of {count}") })
        }
        None => Ok(()),
    }
}

/// Parts of a solid are numbered by the whole numbers that an f32 holds.
const MAX_PARTS: usize = 1 << 24;

fn check_form(index: usize, form: &FormObject, materials: usize) -> Result<(), BuildError> {
    let problem = if form.material as usize >= materials {
        Some("its material does not exist")
    } else if form.copies.iter().any(|copy| !(copy.is_finite() && copy.inverse().is_finite())) {
        Some("a copy is singular or not finite")
    } else if is_far(form) {
        Some("it or a copy reaches beyond 1e12")
    } else if form.projection.is_some_and(|projection| !projection.is_sound()) {
        Some("its projection is singular or not finite")
    } else if form.solid.form_count() > MAX_PARTS {
        Some("it has more than 16 million parts")
    } else {
        None
    };
    problem.map_or(Ok(()), |what| Err(BuildError::Form { form: form.name.clone(), index, what }))
}

/// Whether a form with an end, or a copy of it, reaches beyond the largest coordinate. Of a form without one only the
/// places of copies are known.
fn is_far(form: &FormObject) -> bool {
    let far = |p: DVec3| !p.is_finite() || p.abs().max_element() > f64::from(MAX_COORDINATE);
    let Bounds::Finite { min, max } = form.solid.bounds() else {
        return form.copies.iter().any(|copy| far(copy.translation));
    };
    let (middle, half) = (0.5 * (min + max), 0.5 * (max - min));
    // Half of the box around the moved box is the moved half with all signs the same.
    let is_far_copy = |copy: &DAffine3| {
        let moved = copy.transform_point3(middle);
        let m = copy.matrix3;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        far(moved.abs() + reach)
    };
    if form.copies.is_empty() { far(min) || far(max) } else { form.copies.iter().any(is_far_copy) }
}

/// Of transparent materials with priorities there are at most so many as can be numbered.
fn check_media(materials: &[Material]) -> Result<(), BuildError> {
    let priorities = materials.iter().filter_map(|material| match material.specular {
        SpecularKind::Dielectric { priority, .. } => Some(priority),
        _ => None,
    });
    let count = priorities.clone().count();
    if count > MediumTable::MAX && priorities.clone().any(|priority| priority != 0) {
        let what = "materials of glass beside one with a priority";
        return Err(BuildError::TooMany { what, count, limit: MediumTable::MAX });
    }
    Ok(())
}

fn check_material(index: usize, material: &Material, textures: &[Texture]) -> Result<(), BuildError> {
    let brightest = |texture: u32| textures[texture as usize].range().1;
    let problem = if !is_share(material.diffuse) {
        Some("the diffuse colour is not in [0, 1]")
    } else if let Some(what) = material.noise.as_ref().and_then(noise_problem) {
        Some(what)
    } else if material.textures().any(|texture| texture as usize >= textures.len()) {
        Some("a texture does not exist")
    } else if !is_light(material.emission) {
        Some("the emission is negative or not finite")
    } else if material.emission_texture.is_some_and(|texture| !(material.emission * brightest(texture)).is_finite()) {
        Some("the emission times its texture is not finite")
    } else if !(0.0..=1.0).contains(&material.opacity) {
        Some("the opacity is not in [0, 1]")
    } else {
        specular_problem(material.specular)
    };
    problem.map_or(Ok(()), |what| Err(BuildError::Material { material: material.name.clone(), index, what }))
}

/// Cells of noise that are smaller or larger than this count as given by mistake; between them nothing overflows.
const NOISE_SIZES: std::ops::RangeInclusive<f32> = 1e-6..=1e9;

fn noise_problem(noise: &Noise) -> Option<&'static str> {
    if !noise.size.to_array().iter().all(|size| NOISE_SIZES.contains(size)) {
        Some("a size of the noise is not in [1e-6, 1e9]")
    } else if !(1..=Noise::MAX_OCTAVES).contains(&noise.octaves) {
        Some("the noise does not have 1 to 10 octaves")
    } else if !(0.0..=1000.0).contains(&noise.distortion) {
        Some("the distortion of the noise is not in [0, 1000]")
    } else if !(is_share(noise.low) && is_share(noise.high)) {
        Some("a colour of the noise is not in [0, 1]")
    } else {
        None
    }
}

/// Widths of lobes; the density of narrower ones overflows.
const ALPHAS: std::ops::RangeInclusive<f32> = 1e-4..=1.0;

fn specular_problem(specular: SpecularKind) -> Option<&'static str> {
    match specular {
        SpecularKind::None => None,
        SpecularKind::Ggx { alpha, .. } if !ALPHAS.contains(&alpha) => {
            Some("the roughness (width alpha) is not in [1e-4, 1]: what is smoother is a mirror")
        }
        SpecularKind::Ggx { reflectance, .. } | SpecularKind::Mirror { reflectance } => {
            (!is_share(reflectance)).then_some("the specular colour is not in [0, 1]")
        }
        SpecularKind::Dielectric { ior, .. } if !(0.1..=10.0).contains(&ior) => {
            Some("the refractive index is not in [0.1, 10]")
        }
        SpecularKind::Dielectric { tint, .. } if !is_share(tint) => Some("the tint is not in [0, 1]"),
        SpecularKind::Dielectric { absorption, .. } => {
            (!is_light(absorption)).then_some("the absorption is negative or not finite")
        }
    }
}

fn check_texture(index: usize, texture: &Texture, most: f32) -> Result<(), BuildError> {
    let (low, high) = texture.range();
    if low >= 0.0 && high <= most {
        return Ok(());
    }
    let what = if most > 1.0 { "a value is negative or not finite" } else { "a value is not in [0, 1]" };
    Err(BuildError::Texture { index, what })
}

fn check_light(index: usize, light: &PunctualLight) -> Result<(), BuildError> {
    let problem = match *light {
        PunctualLight::Point { position, .. }
            if !(position.is_finite() && position.abs().max_element() <= MAX_COORDINATE) =>
        {
            Some("the position is not finite or beyond 1e12")
        }
        PunctualLight::Point { intensity, .. } => {
            (!is_light(intensity)).then_some("the intensity is negative or not finite")
        }
        PunctualLight::Directional { direction, .. } if direction.try_normalize().is_none() => {
            Some("the direction is not finite or of length 0")
        }
        PunctualLight::Directional { irradiance, .. } => {
            (!is_light(irradiance)).then_some("the irradiance is negative or not finite")
        }
    };
    problem.map_or(Ok(()), |what| Err(BuildError::Light { index, what }))
}

fn check_environment(environment: &Environment) -> Result<(), BuildError> {
    match environment.pixels.iter().position(|&radiance| !is_light(radiance)) {
        Some(pixel) => Err(BuildError::Environment { pixel, what: "the radiance is negative or not finite" }),
        None => Ok(()),
    }
}

fn check_camera(camera: &crate::Camera) -> Result<(), BuildError> {
    let finite = |v: Vec3| v.is_finite() && v.abs().max_element() <= MAX_COORDINATE;
    if !(finite(camera.eye) && finite(camera.at) && finite(camera.up)) {
        return Err(BuildError::Camera("a number is not finite or beyond 1e12"));
    }
    if !(camera.fov_y_degrees > 0.0 && camera.fov_y_degrees < 180.0) {
        return Err(BuildError::Camera("the angle of view is not between 0 and 180 degrees"));
    }
    match camera.forward() {
        None => Err(BuildError::Camera("eye and at are the same point")),
        Some(forward) if camera.is_upright(forward) => Ok(()),
        Some(_) => Err(BuildError::Camera("up is parallel to the view or of length 0")),
    }
}

/// Whether all channels are in [0, 1].
fn is_share(color: Vec3) -> bool {
    color.cmpge(Vec3::ZERO).all() && color.cmple(Vec3::ONE).all()
}

/// Whether all channels are finite and not negative.
fn is_light(color: Vec3) -> bool {
    color.is_finite() && color.cmpge(Vec3::ZERO).all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use freeform::{FreeForm, Quadric};

    #[test]
    fn forms_and_their_copies_are_within_the_largest_coordinate() {
        let problem = |center: DVec3, radius: f64, copies: Vec<DAffine3>| {
            let solid = FreeForm::new(Quadric::sphere(center, radius).unwrap(), vec![]).unwrap().into();
            let form = FormObject { name: String::new(), solid, material: 0, projection: None, copies };
            check_form(0, &form, 1).err().map(|error| error.to_string())
        };
        let far = Some("free form \"\" (0): it or a copy reaches beyond 1e12".to_owned());
        assert_eq!(problem(DVec3::ZERO, 0.999e12, vec![]), None, "as large as can be");
        assert_eq!(problem(DVec3::ZERO, 1.001e12, vec![]), far, "too large");
        assert_eq!(problem(DVec3::Z * -1e12, 1.0, vec![]), far, "too far");
        let moved = DAffine3::from_translation(DVec3::X * 1e12);
        assert_eq!(problem(DVec3::X * -1e12, 1.0, vec![moved]), None, "only its copies are there");
        assert_eq!(problem(DVec3::ZERO, 1.0, vec![DAffine3::IDENTITY, moved]), far, "a copy too far");
        let grown = DAffine3::from_scale(DVec3::new(1.0, -2e12, 1.0));
        assert_eq!(problem(DVec3::ZERO, 1.0, vec![grown]), far, "a copy too large");
    }
}
