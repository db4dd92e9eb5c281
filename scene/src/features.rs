//! What a scene has.

use glam::Vec3;

use crate::form::Form;
use crate::triangles::Triangles;
use crate::{Lights, Material, SpecularKind};

/// What a scene has, so that what it lacks costs nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Features {
    /// Mirrors or glass.
    pub delta: bool,
    /// Rough specular surfaces.
    pub glossy: bool,
    /// Largest roughness (alpha of GGX) among rough specular surfaces without a diffuse part; 0 where there is none.
    pub widest_metal: f32,
    /// Diffuse surfaces.
    pub diffuse: bool,
    /// Glass, through which light passes.
    pub transmissive: bool,
    /// Glass that absorbs.
    pub absorbing: bool,
    /// Surfaces with holes (`opacity` below 1 or masked).
    pub cut_outs: bool,
    /// Surfaces that shine but are not among the lights that are sampled: free forms without bounds, which scene files
    /// do not allow.
    pub emissive_unsampled: bool,
    /// Triangles and free forms that shine and are sampled.
    pub area_lights: bool,
    /// Point or directional lights.
    pub punctual_lights: bool,
    /// Surroundings that shine.
    pub environment: bool,
    /// Triangles with interpolated normals.
    pub shading_normals: bool,
    /// Free forms.
    pub forms: bool,
}

impl Features {
    /// Looks at all materials that are in use, and at the lights.
    pub(crate) fn find(triangles: &Triangles, forms: &[Form], materials: &[Material], lights: &Lights) -> Self {
        let mut features = Self {
            area_lights: lights.has_area(),
            punctual_lights: lights.has_punctual(),
            environment: lights.has_environment(),
            shading_normals: triangles.has_shading_normals(),
            forms: !forms.is_empty(),
            ..Self::default()
        };
        let mut add = |material: &Material, is_sampled: bool| {
            let is_diffuse = material.is_diffuse();
            features.diffuse |= is_diffuse;
            if let SpecularKind::Ggx { alpha, .. } = material.specular {
                features.glossy = true;
                features.widest_metal =
                    if is_diffuse { features.widest_metal } else { features.widest_metal.max(alpha) };
            }
            features.delta |= material.has_delta();
            if let SpecularKind::Dielectric { absorption, .. } = material.specular {
                features.transmissive = true;
                features.absorbing |= absorption != Vec3::ZERO;
            }
            features.cut_outs |= material.is_cut_out();
            features.emissive_unsampled |= material.is_emissive() && !is_sampled;
        };
        let mut used = vec![false; materials.len()];
        (0..triangles.len()).for_each(|i| used[triangles.material(i) as usize] = true);
        materials.iter().zip(used).filter(|(_, used)| *used).for_each(|(material, _)| add(material, true));
        for form in forms {
            let material = &materials[form.material as usize];
            add(material, form.bounds.is_some());
        }
        features
    }
}
