//! What a caller may ask of [`render`](crate::render), and the check that it makes sense.

use glam::UVec2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{ERROR_RANGE, Study, StudyError};

/// Largest picture, pixels.
pub const MAX_PIXELS: u64 = 1 << 28;
/// Largest width and height, pixels.
pub const MAX_SIDE: u32 = 16_384;
/// Largest number of samples a pixel.
pub const MAX_SPP: u32 = 1 << 20;
/// Least and greatest quality.
pub const QUALITY_RANGE: (f32, f32) = (0.001, 1000.0);

/// Samples a pixel of [`Method::Path`] at quality 1; twice the quality is twice the samples, and so twice the time.
const PATH_SPP: f32 = 256.0;

/// How the picture is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Four terms; the indirect light is gathered at few points and reprojected to the others.
    #[default]
    Reproject,
    /// Four terms; the indirect light is gathered at every point, without a cache.
    Gather,
    /// Four terms; the irradiance on diffuse surfaces is gathered at few points and interpolated, with gradients,
    /// between them.
    #[serde(rename = "cache-only")]
    CacheOnly,
    /// The reference path tracer.
    Path,
}

impl Method {
    /// The name as the command line and the statistics have it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reproject => "reproject",
            Self::Gather => "gather",
            Self::CacheOnly => "cache-only",
            Self::Path => "path",
        }
    }
}

/// Where gather rays take the light of the surfaces that they meet from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SecondaryKind {
    /// A radiosity solution on cells of the surfaces that gather rays meet.
    #[default]
    Cells,
    /// Light sampling there, and a map of photons that were reflected at least once.
    Photons,
    /// Light sampling there, and paths for the rest: slow, and without bias.
    Paths,
}

/// The settings of a picture. [`Settings::default`] is a picture of 640 x 360 at quality 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How the picture is made.
    pub method: Method,
    /// One number for speed against accuracy, in [0.001, 1000]: four times the quality takes about three times the
    /// time, below 1 twice; by [`Method::Path`] four times.
    pub quality: f32,
    /// Primary samples a pixel, in [1, 2^20]: exactly so many by [`Method::Path`]. The others take about as many
    /// rays as so many everywhere would, more of them where there is noise. Where it is `None`, `quality` decides.
    pub spp: Option<u32>,
    /// Width and height, pixels: each in [1, 16384], together at most 2^28.
    pub size: UVec2,
    /// Single settings that overrule the quality.
    pub study: Study,
    /// Whether the film tells how each pixel got its indirect light, see [`Film::rungs`](crate::Film::rungs). The
    /// picture is the same.
    pub rungs: bool,
    /// Whether the rendering tells where the records are, see [`Rendering::records`](crate::Rendering::records). The
    /// picture is the same.
    pub records: bool,
    /// Any number; another seed gives a statistically independent picture.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            quality: 1.0,
            spp: None,
            size: UVec2::new(640, 360),
            study: Study::default(),
            rungs: false,
            records: false,
            seed: 0,
        }
    }
}

impl Settings {
    /// Checks every setting.
    ///
    /// # Errors
    ///
    /// The first setting that is out of its range, by name.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let UVec2 { x, y } = self.size;
        if !(1..=MAX_SIDE).contains(&x) || !(1..=MAX_SIDE).contains(&y) {
            return Err(SettingsError::Size { width: x, height: y });
        }
        if u64::from(x) * u64::from(y) > MAX_PIXELS {
            return Err(SettingsError::Pixels { width: x, height: y });
        }
        if let Some(spp) = self.spp
            && !(1..=MAX_SPP).contains(&spp)
        {
            return Err(SettingsError::Spp(spp));
        }
        // Written so that NaN is refused.
        if !(QUALITY_RANGE.0..=QUALITY_RANGE.1).contains(&self.quality) {
            return Err(SettingsError::Quality(self.quality));
        }
        Ok(self.study.validate()?)
    }

    /// Returns the samples a pixel of the path tracer: `spp`, or 256 times `quality`.
    #[must_use]
    pub fn path_spp(&self) -> u32 {
        self.spp.unwrap_or_else(|| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "validated, so at most 256,000"
            )]
            let spp = (PATH_SPP * self.quality).round() as u32;
            spp.clamp(1, MAX_SPP)
        })
    }
}

/// A setting that is out of its range.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// A side of the picture.
    #[error("size {width}x{height}: each side must lie between 1 and {MAX_SIDE} pixels")]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
    },
    /// The number of pixels.
    #[error("size {width}x{height}: at most {MAX_PIXELS} pixels")]
    Pixels {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
    },
    /// A pixel outside of the picture.
    #[error("pixel {pixel}: the picture has {} x {} of them, counted from 0", .size.x, .size.y)]
    Pixel {
        /// The pixel asked for.
        pixel: UVec2,
        /// Size of the picture.
        size: UVec2,
    },
    /// Samples a pixel.
    #[error("spp {0}: must lie between 1 and {MAX_SPP}")]
    Spp(u32),
    /// The quality.
    #[error("quality {0}: must lie between {min} and {max}", min = QUALITY_RANGE.0, max = QUALITY_RANGE.1)]
    Quality(f32),
    /// The error asked for, see [`render_to_error`](crate::render_to_error).
    #[error("error {0}: must lie between {min} and {max}", min = ERROR_RANGE.0, max = ERROR_RANGE.1)]
    Error(f32),
    /// A single setting.
    #[error(transparent)]
    Study(#[from] StudyError),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(change: impl FnOnce(&mut Settings)) -> Result<(), SettingsError> {
        let mut settings = Settings::default();
        change(&mut settings);
        settings.validate()
    }

    #[test]
    fn default_is_valid() {
        assert_eq!(Settings::default().validate(), Ok(()), "the defaults");
    }

    #[test]
    fn limits_are_accepted_and_one_more_is_refused() {
        let size = |x, y| with(|s| s.size = UVec2::new(x, y));
        assert_eq!(size(1, 1), Ok(()), "smallest picture");
        assert_eq!(size(16_384, 16_384), Ok(()), "largest picture, exactly 2^28 pixels");
        assert_eq!(size(0, 9), Err(SettingsError::Size { width: 0, height: 9 }), "no width");
        assert_eq!(size(1_000_000_000, 1), Err(SettingsError::Size { width: 1_000_000_000, height: 1 }), "too wide");
        assert_eq!(with(|s| s.spp = Some(1 << 20)), Ok(()), "most samples");
        assert_eq!(with(|s| s.spp = Some(0)), Err(SettingsError::Spp(0)), "no sample");
        assert_eq!(with(|s| s.spp = Some((1 << 20) + 1)), Err(SettingsError::Spp((1 << 20) + 1)), "too many samples");
        assert_eq!(with(|s| s.quality = 0.001), Ok(()), "least quality");
        assert_eq!(with(|s| s.quality = 0.0), Err(SettingsError::Quality(0.0)), "no quality");
        assert!(with(|s| s.quality = f32::NAN).is_err(), "NaN is not a quality");
    }

    #[test]
    fn errors_name_the_setting() {
        let text = with(|s| s.size.x = 0).unwrap_err().to_string();
        assert!(text.starts_with("size 0x360"), "{text}");
        let text = with(|s| s.quality = 5000.0).unwrap_err().to_string();
        assert_eq!(text, "quality 5000: must lie between 0.001 and 1000", "wording");
    }

    #[test]
    fn quality_sets_the_samples_of_the_path_tracer() {
        let spp = |quality, spp| Settings { quality, spp, ..Settings::default() }.path_spp();
        assert_eq!([spp(1.0, None), spp(2.0, None), spp(0.001, None)], [256, 512, 1], "by quality");
        assert_eq!(spp(8.0, Some(3)), 3, "asked for");
    }
}
