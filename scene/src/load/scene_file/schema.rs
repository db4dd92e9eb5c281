//! The tables of a scene file as serde reads them; docs/scene-format.md describes each field.
//!
//! Neither `flatten` nor untagged enums: with either an error names the wrong line (toml-rs/toml#589, #593).

use serde::Deserialize;
use toml::Spanned;

use super::values::{
    Alpha, Amount, Angles, Coefficients, Counts, Direction, Distortion, Exposure, Factor, FieldOfView, FilmSize,
    Fraction, Index, Length, NoiseSize, Octaves, Point, Quality, Radii, Real, Scale, Share, Sizes, Spp, Uv,
};

/// A whole file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SceneFile {
    pub(super) version: Option<Spanned<u32>>,
    pub(super) include: Vec<Spanned<String>>,
    pub(super) film: Option<FilmTable>,
    pub(super) render: Option<RenderTable>,
    pub(super) camera: Option<Spanned<CameraTable>>,
    pub(super) environment: Option<Spanned<EnvironmentTable>>,
    pub(super) material: Vec<MaterialTable>,
    pub(super) mesh: Vec<Spanned<MeshTable>>,
    pub(super) form: Vec<Spanned<FormTable>>,
    pub(super) light: Vec<LightTable>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct FilmTable {
    pub(super) size: Option<FilmSize>,
    pub(super) exposure: Option<Exposure>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RenderTable {
    pub(super) quality: Option<Quality>,
    pub(super) spp: Option<Spp>,
    pub(super) seed: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    pub(super) eye: Point,
    pub(super) at: Point,
    pub(super) up: Option<Direction>,
    pub(super) fov: Option<FieldOfView>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct EnvironmentTable {
    pub(super) file: Option<Spanned<String>>,
    pub(super) scale: Option<Factor>,
    pub(super) radiance: Option<Amount>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialTable {
    pub(super) name: Spanned<String>,
    pub(super) diffuse: Option<Share>,
    pub(super) diffuse_texture: Option<Spanned<String>>,
    pub(super) noise: Option<Spanned<NoiseTable>>,
    pub(super) gloss: Option<GlossTable>,
    pub(super) mirror: Option<MirrorTable>,
    pub(super) glass: Option<GlassTable>,
    pub(super) specular_texture: Option<Spanned<String>>,
    pub(super) emission: Option<Amount>,
    pub(super) emission_texture: Option<Spanned<String>>,
    pub(super) opacity: Option<Fraction>,
    pub(super) opacity_texture: Option<Spanned<String>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NoiseTable {
    pub(super) pattern: PatternName,
    pub(super) size: NoiseSize,
    pub(super) octaves: Option<Octaves>,
    pub(super) distortion: Option<Distortion>,
    pub(super) low: Option<Share>,
    pub(super) high: Option<Share>,
    #[serde(default)]
    pub(super) seed: i32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PatternName {
    Clouds,
    Marble,
    Wood,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GlossTable {
    pub(super) alpha: Alpha,
    pub(super) reflectance: Share,
    #[serde(default)]
    pub(super) schlick: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MirrorTable {
    pub(super) reflectance: Share,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GlassTable {
    pub(super) ior: Index,
    pub(super) tint: Option<Share>,
    pub(super) absorption: Option<Amount>,
    #[serde(default)]
    pub(super) priority: i32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MeshTable {
    pub(super) name: String,
    pub(super) material: Option<Spanned<String>>,
    pub(super) file: Option<Spanned<String>>,
    pub(super) positions: Vec<Point>,
    pub(super) normals: Vec<Direction>,
    pub(super) uvs: Vec<Uv>,
    pub(super) faces: Vec<Spanned<Vec<u32>>>,
    pub(super) scale: Option<Scale>,
    pub(super) rotate: Option<Angles>,
    pub(super) translate: Option<Point>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct FormTable {
    pub(super) name: String,
    pub(super) material: Option<Spanned<String>>,
    pub(super) text: Option<Spanned<String>>,
    pub(super) origin: Option<Point>,
    pub(super) quadric: Option<Spanned<QuadricTable>>,
    pub(super) perturbations: Vec<Spanned<PerturbationTable>>,
    pub(super) weight: Option<Length>,
    pub(super) union: Option<Vec<Spanned<PartTable>>>,
    pub(super) intersection: Option<Vec<Spanned<PartTable>>>,
    pub(super) difference: Option<Vec<Spanned<PartTable>>>,
    pub(super) complement: Option<Box<Spanned<PartTable>>>,
    pub(super) psi: Option<PsiTable>,
    pub(super) clip: Option<Spanned<ClipTable>>,
    pub(super) projection: Option<Spanned<ProjectionTable>>,
    pub(super) repeat: Option<Spanned<RepeatTable>>,
    pub(super) scale: Option<Scale>,
    pub(super) rotate: Option<Angles>,
    pub(super) translate: Option<Point>,
}

/// Copies of a form.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RepeatTable {
    pub(super) count: Counts,
    pub(super) step: Point,
    pub(super) jitter: Option<Point>,
    pub(super) turn: Option<Angles>,
    pub(super) size: Option<Sizes>,
    #[serde(default)]
    pub(super) seed: u64,
}

/// How a form gets its texture coordinates.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum ProjectionTable {
    Planar { origin: Option<Point>, right: Point, up: Point },
    Spherical { center: Option<Point>, axis: Option<Direction>, front: Option<Direction> },
    Box { center: Option<Point>, size: Length },
}

/// A part of a set operation: a form without a name and a material of its own.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PartTable {
    pub(super) text: Option<Spanned<String>>,
    pub(super) origin: Option<Point>,
    pub(super) quadric: Option<Spanned<QuadricTable>>,
    pub(super) perturbations: Vec<Spanned<PerturbationTable>>,
    pub(super) weight: Option<Length>,
    pub(super) union: Option<Vec<Spanned<Self>>>,
    pub(super) intersection: Option<Vec<Spanned<Self>>>,
    pub(super) difference: Option<Vec<Spanned<Self>>>,
    pub(super) complement: Option<Box<Spanned<Self>>>,
    pub(super) psi: Option<PsiTable>,
    pub(super) clip: Option<Spanned<ClipTable>>,
    pub(super) scale: Option<Scale>,
    pub(super) rotate: Option<Angles>,
    pub(super) translate: Option<Point>,
}

/// Where a form ends that would not end by itself.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClipTable {
    pub(super) min: Point,
    pub(super) max: Point,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum PsiTable {
    Maximum,
    RFunction,
    Blend { width: Length },
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PerturbationTable {
    pub(super) quadric: Spanned<QuadricTable>,
    pub(super) factor: Real,
    pub(super) scale: Option<Scale>,
    pub(super) rotate: Option<Angles>,
    pub(super) translate: Option<Point>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum QuadricTable {
    Coefficients(Coefficients),
    Ellipsoid {
        center: Point,
        radii: Radii,
    },
    Sphere {
        center: Point,
        radius: Length,
    },
    Cylinder {
        point: Point,
        axis: Direction,
        radius: Length,
    },
    Cone {
        apex: Point,
        axis: Direction,
        slope: Length,
    },
    Paraboloid {
        vertex: Point,
        axis: Direction,
        focal_length: Length,
    },
    OneSheet {
        center: Point,
        axis: Direction,
        radius: Length,
        slope: Length,
    },
    TwoSheets {
        center: Point,
        axis: Direction,
        height: Length,
        slope: Length,
    },
    Saddle {
        point: Point,
        axis: Direction,
        along: Direction,
        rise: Length,
        fall: Length,
    },
    #[serde(alias = "plane")]
    HalfSpace {
        point: Point,
        normal: Direction,
    },
    Slab {
        point: Point,
        normal: Direction,
        half_thickness: Length,
    },
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum LightTable {
    Point { position: Point, intensity: Amount },
    Directional { direction: Direction, irradiance: Amount },
}
