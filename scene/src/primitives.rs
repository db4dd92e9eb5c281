//! The primitives of a scene, triangles and then free forms: all for the tree, and those that shine or are looked for.

use std::sync::Arc;

use glam::Vec2;
use rayon::prelude::*;

use crate::bvh::Primitive;
use crate::form::Form;
use crate::light::{Areas, FormLight, Pattern, TriangleLight};
use crate::triangles::Triangles;
use crate::{Aabb, Material, Texture};

/// Returns the geometry in the order of its numbering.
pub(crate) fn primitives(triangles: &Triangles, forms: &[Form], materials: &[Material]) -> Vec<Primitive> {
    let triangle = |i: usize| {
        if triangles.area_normal(i).length_squared() > 0.0 {
            let cut_out = materials[triangles.material(i) as usize].is_cut_out();
            Primitive::Triangle { corners: triangles.corners(i), cut_out }
        } else {
            Primitive::Nothing
        }
    };
    let form = |form: &Form| form.bounds.map_or(Primitive::Nothing, Primitive::Form);
    (0..triangles.len()).map(triangle).chain(forms.iter().map(form)).collect()
}

/// Returns the boxes around all surfaces of the materials that are wanted; `None` if one of them has no bounds.
pub(crate) fn boxes(
    triangles: &Triangles,
    forms: &[Form],
    materials: &[Material],
    is_wanted: impl Fn(&Material) -> bool,
) -> Option<Vec<Aabb>> {
    let wanted: Vec<bool> = materials.iter().map(is_wanted).collect();
    let of_triangles = (0..triangles.len())
        .filter(|&i| wanted[triangles.material(i) as usize])
        .map(|i| Some(Aabb::of_points(&triangles.corners(i))));
    let of_forms = forms.iter().filter(|form| wanted[form.material as usize]).map(|form| form.bounds);
    of_triangles.chain(of_forms).collect()
}

/// Returns the triangles that shine.
pub(crate) fn triangle_lights(
    triangles: &Triangles,
    materials: &[Material],
    textures: &[Arc<Texture>],
) -> Vec<TriangleLight> {
    let light = |primitive: u32| {
        let i = primitive as usize;
        let material = &materials[triangles.material(i) as usize];
        if !material.is_emissive() {
            return None;
        }
        let light = TriangleLight::new(triangles.corners(i), material.emission * material.opacity, primitive)?;
        match Pattern::new(material, textures) {
            Some(pattern) => {
                let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y].map(|barycentrics| triangles.uv(i, barycentrics));
                light.with_pattern(pattern, uvs)
            }
            None => Some(light),
        }
    };
    let count = u32::try_from(triangles.len()).expect("primitives are limited to less than 2^32");
    (0..count).into_par_iter().filter_map(light).collect()
}

/// Returns the free forms that shine; those without bounds are left to chance.
pub(crate) fn form_lights(
    triangles: &Triangles,
    forms: &[Form],
    materials: &[Material],
    textures: &[Arc<Texture>],
) -> Vec<FormLight> {
    let first = triangles.len();
    let shines = |form: &Form| materials[form.material as usize].is_emissive();
    let mut areas = Areas::new(forms.iter().filter(|form| shines(form)).map(|form| &form.body));
    let light = |(primitive, form): (usize, &Form)| {
        if !(shines(form) && form.bounds.is_some()) {
            return None;
        }
        let material = &materials[form.material as usize];
        let primitive = u32::try_from(primitive).expect("primitives are limited to less than 2^32");
        let light = FormLight::new(&form.body, material.emission, material.opacity, primitive, &mut areas)?;
        Some(match Pattern::new(material, textures) {
            Some(pattern) => light.with_pattern(pattern, form.projector.clone(), &mut areas),
            None => light,
        })
    };
    (first..).zip(forms).filter_map(light).collect()
}
