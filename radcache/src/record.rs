//! A record: where it was made, what it saw, and how it is divided into elements.

use glam::{Vec3, Vec3A};
use hemimap::Frame;
use serde::Serialize;

use crate::{Elements, MergeSettings, Samples, Validity};

/// How samples become a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordSettings {
    /// Number of depth layers, K of the paper, 1 to 256. More layers tell more exactly what hides what; with
    /// [`DepthRange::Layer`](crate::DepthRange::Layer) less merges then.
    pub layers: usize,
    /// When texels merge.
    pub merge: MergeSettings,
}

impl Default for RecordSettings {
    /// 16 layers.
    fn default() -> Self {
        Self { layers: 16, merge: MergeSettings::default() }
    }
}

/// Incident radiance at one point of a surface, with what is needed to see it from elsewhere.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Record {
    pub(crate) centre: Vec3,
    pub(crate) frame: [Vec3; 3],
    pub(crate) samples: Samples,
    pub(crate) elements: Elements,
    pub(crate) harmonic_distance: f32,
    pub(crate) radius: f32,
}

impl Record {
    /// Makes a record from samples taken at `centre` in `frame`, whose z axis is the normal there. The frame must be
    /// right-handed and of unit vectors at right angles, and radiance finite: what reprojects it relies on that, and it
    /// is checked only where records are read from bytes.
    ///
    /// # Panics
    /// If `settings.layers` is 0 or above 256, or if the samples do not keep what [`Samples`] says of them: a texture
    /// is not n x n, or a distance is negative or NaN.
    #[must_use]
    pub fn new(centre: Vec3A, frame: Frame, samples: Samples, settings: &RecordSettings, validity: &Validity) -> Self {
        assert!((1..=256).contains(&settings.layers), "records have 1 to 256 layers");
        assert!(samples.has_all_texels(), "textures of samples must be n x n");
        assert!(samples.distance.iter().all(|&d| d >= 0.0), "distances of samples must be 0 or more, not NaN");
        let elements = Elements::new(&samples, settings.layers, &settings.merge);
        Self {
            centre: centre.into(),
            frame: [frame.s.into(), frame.t.into(), frame.n.into()],
            harmonic_distance: samples.harmonic_distance(),
            radius: validity.radius(&samples),
            elements,
            samples,
        }
    }

    /// Where it was made, world space, metres.
    #[must_use]
    pub fn centre(&self) -> Vec3A {
        self.centre.into()
    }

    /// Its frame in world space, z along the normal.
    #[must_use]
    pub fn frame(&self) -> Frame {
        let [s, t, n] = self.frame.map(Vec3A::from);
        Frame { s, t, n }
    }

    /// What it saw.
    #[must_use]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Its s-elements.
    #[must_use]
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// Harmonic mean distance to what it saw, metres.
    #[must_use]
    pub fn harmonic_distance(&self) -> f32 {
        self.harmonic_distance
    }

    /// Reach in metres; 0 for a record that must not be used elsewhere.
    #[must_use]
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Mean radiance over the cosine-weighted hemisphere: irradiance / pi.
    #[must_use]
    pub fn mean_radiance(&self) -> Vec3 {
        self.samples.mean_radiance()
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let texel = size_of::<Vec3>() * 2 + 2 * size_of::<f32>() + size_of::<glam::Vec2>() + size_of::<bool>();
        size_of::<Self>() + self.samples.radiance.len() * texel + self.elements.memory_bytes()
    }
}
