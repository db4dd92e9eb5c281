#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod body;
mod bounds;
mod bvh;
mod camera;
mod check;
mod clear;
mod contact;
mod description;
mod environment;
mod error;
mod features;
mod form;
mod holes;
mod light;
mod load;
mod material;
mod media;
mod mix;
mod noise;
mod primitives;
mod projection;
mod ray;
mod scene;
mod shaft;
mod srgb;
mod surface;
mod texture;
mod triangles;

pub use bounds::Aabb;
pub use camera::Camera;
pub use clear::Patch;
pub use description::{Description, FormObject, Material, Mesh, NO_INDEX, PunctualLight, SpecularKind};
pub use environment::Environment;
pub use error::BuildError;
pub use features::Features;
pub use freeform;
pub use glam;
pub use light::{Emission, LightChoice, LightDirection, LightLesson, LightSample, Lights, SeenLights, Target};
pub use load::{
    FileSettings, LoadError, LoadOptions, Loaded, Picture, PictureFormat, Problem, limits, load, load_embedded,
    read_file,
};
pub use material::{Bsdf, BsdfSample, Lobes, Specular, fresnel_dielectric};
pub use media::Media;
pub use noise::{Noise, Pattern};
pub use projection::{Projection, ProjectionShape};
pub use ray::{Hit, Ray};
pub use scene::Scene;
pub use surface::Surface;
pub use texture::Texture;
