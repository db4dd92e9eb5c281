//! What an MTL material means as a [`Material`]; docs/materials.md tells it to users.

use std::path::Path;

use glam::Vec3;

use super::error::{LoadError, Place};
use super::mtl::{At, MtlMaterial};
use super::warnings::Warnings;
use crate::description::{Material, SpecularKind};

/// Smallest microfacet width: below it the lobe is narrower than single precision resolves.
const LEAST_ALPHA: f32 = 1e-3;
/// Refractive indices that bodies have.
const INDICES: std::ops::RangeInclusive<f32> = 0.1..=10.0;

/// Translates a material of the library `file`; textures are the caller's to add.
pub(super) fn translate(mtl: &MtlMaterial, file: &Path, warnings: &mut Warnings) -> Result<Material, LoadError> {
    // A material that says nothing of its colour is grey, unless it shines or is glossy.
    let is_specular = mtl.specular.is_some() || mtl.specular_map.is_some();
    let silent = !is_specular && mtl.emission.is_none() && mtl.emission_map.is_none();
    let unsaid = if mtl.diffuse_map.is_some() { Vec3::ONE } else { Vec3::splat(if silent { 0.5 } else { 0.0 }) };
    let diffuse = mtl.diffuse.unwrap_or(unsaid);
    let (specular, diffuse) = match dielectric(mtl, file, warnings)? {
        Some(body) => (body, Vec3::ZERO),
        None => opaque(mtl, diffuse),
    };
    let transmits = matches!(specular, SpecularKind::Dielectric { .. });
    let opacity = match (mtl.dissolve, mtl.transparency) {
        _ if transmits => 1.0,
        (Some(d), Some(tr)) => {
            if (d - (1.0 - tr)).abs() > 1e-3 {
                warnings.add(format!("{}: d and Tr are at odds, d is taken", Place::file(file)));
            }
            d
        }
        (Some(d), None) => d,
        (None, Some(tr)) => 1.0 - tr,
        (None, None) => 1.0,
    };
    Ok(Material {
        name: mtl.name.clone(),
        diffuse,
        diffuse_texture: None,
        noise: None,
        specular,
        specular_texture: None,
        emission: mtl.emission.unwrap_or(if mtl.emission_map.is_some() { Vec3::ONE } else { Vec3::ZERO }),
        emission_texture: None,
        opacity,
        opacity_texture: None,
    })
}

/// Returns `Ks`; 1 where there is `map_Ks` alone.
fn specular_colour(mtl: &MtlMaterial) -> Vec3 {
    mtl.specular.unwrap_or(if mtl.specular_map.is_some() { Vec3::ONE } else { Vec3::ZERO })
}

/// Returns the picture of what gloss or a mirror reflects: that of `Kd` for a metal without `Ks`.
pub(super) fn reflectance_map(mtl: &MtlMaterial) -> Option<&At<String>> {
    let is_metal = mtl.metalness.is_some_and(|metalness| metalness > 0.0);
    let map = if is_metal && specular_colour(mtl) == Vec3::ZERO { &mtl.diffuse_map } else { &mtl.specular_map };
    map.as_ref()
}

/// A smooth dielectric where `illum` is 4, 6, 7 or 9 and `Ni` is not 1.
fn dielectric(mtl: &MtlMaterial, file: &Path, warnings: &mut Warnings) -> Result<Option<SpecularKind>, LoadError> {
    let Some(index) = mtl.index else { return Ok(None) };
    let sensible = INDICES.contains(&index.value);
    if !illuminates(mtl, &[4.0, 6.0, 7.0, 9.0]) {
        if !sensible {
            warnings.add(format!("{}: Ni out of range is not used, the material is opaque", Place::file(file)));
        }
        return Ok(None);
    }
    if !sensible {
        let what = format!("Ni {} is no refractive index", index.value);
        let advice = format!("give a number from {} to {}", INDICES.start(), INDICES.end());
        return Err(Place::line(file, index.line).invalid(what, advice));
    }
    if index.value == 1.0 {
        return Ok(None);
    }
    if mtl.roughness.is_some_and(|roughness| roughness > 0.0) {
        warnings.add(format!("{}: rough glass is not supported, it is taken as smooth", Place::file(file)));
    }
    let tint = mtl.filter.unwrap_or(Vec3::ONE);
    Ok(Some(SpecularKind::Dielectric { ior: index.value, tint, absorption: Vec3::ZERO, priority: 0 }))
}

/// Metal, mirror, gloss or Lambert, with the diffuse albedo.
fn opaque(mtl: &MtlMaterial, diffuse: Vec3) -> (SpecularKind, Vec3) {
    let specular = specular_colour(mtl);
    let metalness = mtl.metalness.unwrap_or(0.0);
    let coloured = if specular == Vec3::ZERO { diffuse } else { specular };
    // Between 0 and 1 `Pm` mixes the reflectances of the two ends.
    let reflectance = specular.lerp(coloured, metalness);
    let diffuse = diffuse * (1.0 - metalness);
    let alpha = match (mtl.roughness, mtl.exponent) {
        (Some(roughness), _) => roughness * roughness,
        (None, Some(exponent)) => (2.0 / (exponent + 2.0)).sqrt(),
        (None, None) => 1.0,
    };
    let smooth = mtl.roughness.map_or(mtl.exponent.is_none(), |_| alpha < LEAST_ALPHA);
    let black = diffuse == Vec3::ZERO;
    let metal_mirror = metalness == 1.0 && mtl.roughness.is_some() && smooth;
    if black && (metal_mirror || (smooth && illuminates(mtl, &[3.0, 5.0]))) {
        let reflectance = if mtl.specular.is_none() && metalness == 0.0 { Vec3::ONE } else { reflectance };
        return (SpecularKind::Mirror { reflectance }, diffuse);
    }
    if reflectance == Vec3::ZERO {
        return (SpecularKind::None, diffuse);
    }
    let schlick = illuminates(mtl, &[5.0, 7.0]);
    (SpecularKind::Ggx { alpha: alpha.clamp(LEAST_ALPHA, 1.0), reflectance, schlick }, diffuse)
}

/// Whether the illumination model is one of these.
fn illuminates(mtl: &MtlMaterial, models: &[f32]) -> bool {
    mtl.illumination.is_some_and(|model| models.contains(&model))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::files::Files;
    use crate::load::mtl;

    fn meaning(text: &str) -> Material {
        let text = format!("newmtl m\n{}", text.replace("; ", "\n"));
        let path = Path::new("m.mtl");
        let list = [("m.mtl", text.as_bytes())];
        let mut warnings = Warnings::default();
        let read = mtl::read(Files::Embedded(&list), path, Place::file(path), &mut warnings).unwrap();
        translate(&read[0], path, &mut warnings).unwrap()
    }

    #[test]
    fn width_is_roughness_squared_or_from_the_exponent() {
        let reflectance = Vec3::new(0.9, 0.85, 0.75);
        for text in
            ["illum 3; Kd 0 0 0; Ks 0.9 0.85 0.75; Ns 198; Pr 0.316228; Pm 1", "Kd 0; Ks 0.9 0.85 0.75; Ns 198; Pm 1"]
        {
            let SpecularKind::Ggx { alpha, reflectance: found, schlick } = meaning(text).specular else {
                panic!("{text} is rough")
            };
            assert!((alpha - 0.1).abs() < 1e-5 && found == reflectance && !schlick, "{text}: {alpha}");
        }
        let schlick = meaning("illum 5; Kd 0; Ks 0.5; Ns 98").specular;
        assert_eq!(
            schlick,
            SpecularKind::Ggx { alpha: 0.02_f32.sqrt(), reflectance: Vec3::splat(0.5), schlick: true },
            "illum 5"
        );
    }

    #[test]
    fn glass_is_tinted_and_never_cut_out() {
        let glass = meaning("Kd 0.3 0.3 0.3; Tf 1 0.9 0.8; Ni 1.5; d 0; illum 7");
        let tint = Vec3::new(1.0, 0.9, 0.8);
        assert_eq!(
            glass.specular,
            SpecularKind::Dielectric { ior: 1.5, tint, absorption: Vec3::ZERO, priority: 0 },
            "illum 7"
        );
        assert_eq!((glass.opacity, glass.diffuse), (1.0, Vec3::ZERO), "d and Kd are ignored");
        let cut = meaning("Kd 0.3 0.3 0.3; Ni 1; d 0.25; illum 4");
        assert_eq!((cut.specular, cut.opacity), (SpecularKind::None, 0.25), "an index of 1 is air");
        assert_eq!(meaning("Ni 1.5; illum 2").specular, SpecularKind::None, "illum 2 does not transmit");
    }

    #[test]
    fn mirrors_are_black_and_smooth() {
        assert_eq!(
            meaning("illum 3; Kd 0; Ks 0.9").specular,
            SpecularKind::Mirror { reflectance: Vec3::splat(0.9) },
            "illum 3"
        );
        assert_eq!(
            meaning("illum 5; Kd 0; Ks 0.9; Pr 0").specular,
            SpecularKind::Mirror { reflectance: Vec3::splat(0.9) },
            "Pr 0"
        );
        assert!(
            matches!(meaning("illum 3; Kd 0; Ks 0.9; Pr 0.5").specular, SpecularKind::Ggx { .. }),
            "Pr 0.5 is rough"
        );
        assert!(matches!(meaning("illum 3; Kd 0.5; Ks 0.4").specular, SpecularKind::Ggx { .. }), "Kd is not black");
    }

    #[test]
    fn metal_takes_kd_where_there_is_no_ks() {
        let metal = meaning("Kd 0.8 0.6 0.2; Pm 1; Pr 0.5");
        let reflectance = Vec3::new(0.8, 0.6, 0.2);
        assert_eq!(metal.specular, SpecularKind::Ggx { alpha: 0.25, reflectance, schlick: false }, "gold");
        assert_eq!(metal.diffuse, Vec3::ZERO, "metal has no diffuse part");
    }

    #[test]
    fn silence_is_grey_and_lamps_are_black() {
        assert_eq!(meaning("Ka 1 1 1").diffuse, Vec3::splat(0.5), "grey");
        let lamp = meaning("Ke 17 12 4");
        assert_eq!((lamp.diffuse, lamp.emission), (Vec3::ZERO, Vec3::new(17.0, 12.0, 4.0)), "a lamp");
        assert_eq!(meaning("Kd 0.3; Ke 1").diffuse, Vec3::splat(0.3), "Kd of a lamp reflects");
        assert_eq!((meaning("d 0.3; Tr 0.3").opacity, meaning("Tr 0.25").opacity), (0.3, 0.75), "d wins over Tr");
    }
}
