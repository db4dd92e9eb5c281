//! Single settings of the methods, for study: each overrules what the quality and the scene would choose.

use std::fmt::Display;
use std::str::FromStr;

use radcache::{DepthRange, MergeSettings};
use reproject::{AreaWeights, Coverage, Trails};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::SecondaryKind;

/// Settings that overrule those of the quality; `None` leaves one as it is.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Study {
    /// Texels along a side of a gather, 1 to 64.
    pub resolution: Option<u32>,
    /// Reach of records as a share of the harmonic mean distance, 0.001 to 10.
    pub spacing: Option<f32>,
    /// Error that a record of irradiance may sum to, 1e-9 to 1, where 1 is an error of 100 % on the whole picture.
    pub error: Option<f32>,
    /// Depth layers, 2 to 256.
    pub layers: Option<u32>,
    /// Texels along a side of an s-element at most, 1 to 64; 1 merges nothing.
    pub merge: Option<u32>,
    /// Whether s-elements have the same greatest side at every distance, or half of it where they are near.
    pub even_sides: Option<bool>,
    /// Whether an s-element lies in one depth layer, as in the paper, or is as deep as its parallax allows.
    pub by_layer: Option<bool>,
    /// Texels along a side of the block that a hole ray stands for at most, 1 to 64: points with few holes take smaller ones.
    pub step: Option<u32>,
    /// Verification rays along a side, 0 to 8; 0 verifies nothing.
    pub verify: Option<u32>,
    /// Light samples a primary sample, 1 to 1024.
    pub light_samples: Option<u32>,
    /// Whether half of the light samples of surfaces without gloss go to lights that were found to reach them beforehand.
    pub light_guide: Option<bool>,
    /// Rays through a traced glossy lobe for each primary sample, 1 to 1024; a lobe that is narrow or dim takes fewer.
    pub lobe_rays: Option<u32>,
    /// Whether half of the rays of wide lobes go where light was found beforehand.
    pub lobe_guide: Option<bool>,
    /// Whether neighbours share what the rays of their lobes find.
    pub lobe_reuse: Option<bool>,
    /// Roughness (alpha of GGX) from which on a glossy lobe without a diffuse part reads a texture instead of being traced, 0 to 2; never where a
    /// texture is too coarse.
    pub texture_alpha: Option<f32>,
    /// Photons to shoot into each map that the scene needs, 1 to 10^8.
    pub photons: Option<u32>,
    /// Whether elements cover the rectangle around their corners, as in the paper, or their quadrilateral.
    pub rectangles: Option<bool>,
    /// What leaves trails, and how long ones; all elements do in the paper.
    pub trails: Option<Trails>,
    /// Whether shares are counted in bits or measured as areas.
    pub count_bits: Option<bool>,
    /// Whether records of irradiance reach a share of the harmonic mean distance (Ward 1988), or as far as the Hessian says.
    pub by_distance: Option<bool>,
    /// Whether records of irradiance know its gradients.
    pub gradients: Option<bool>,
    /// Whether records of irradiance stop at walls that they met near their horizon.
    pub walls: Option<bool>,
    /// Whether thin gaps take records of irradiance of their own.
    pub gaps: Option<bool>,
    /// Whether records reach no farther than a quarter of the scene and of what the picture shows there.
    pub limit: Option<bool>,
    /// Whether texels of a gather between bright and dark, and at the rim of the sky, are divided.
    pub divide: Option<bool>,
    /// Whether highlights that a record met are traced anew where it is reprojected.
    pub highlights: Option<bool>,
    /// Whether the last texel inside a silhouette that retreats is unknown.
    pub margins: Option<bool>,
    /// Whether a point below the tangent plane of a record doubts what the record could not see.
    pub doubt: Option<bool>,
    /// Whether all pixels take the same number of primary samples: those asked for, or 16 at quality 1.
    pub even_samples: Option<bool>,
    /// Where gather rays take the light of the surfaces that they meet from.
    pub secondary: Option<SecondaryKind>,
}

/// A setting for study that does not exist or is out of its range.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// No setting of this name.
    #[error(
        "{0}: there is no such setting; it is one of resolution, spacing, error, layers, merge, sides, depth, step, verify, light-samples, light-guide, lobe-rays, lobe-guide, lobe-reuse, texture-alpha, photons, coverage, trail, weights, reach, gradients, walls, gaps, limit, divide, highlights, margins, doubt, samples, secondary"
    )]
    Unknown(String),
    /// A value that is not among those of the setting.
    #[error("{name} {value}: must be {expected}")]
    Value {
        /// The setting.
        name: String,
        /// What was given.
        value: String,
        /// What it takes.
        expected: String,
    },
}

impl Study {
    /// Sets one setting from text, as the command line writes it.
    ///
    /// # Errors
    ///
    /// When there is no such setting, or the value is not one that it takes.
    ///
    /// ```
    /// let mut study = integrator::Study::default();
    /// study.set("coverage", "rect").unwrap();
    /// assert_eq!(study.rectangles, Some(true));
    /// assert!(study.set("layers", "1000").is_err());
    /// ```
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), StudyError> {
        match name {
            "resolution" => self.resolution = Some(number(name, value, 1, 64)?),
            "spacing" => self.spacing = Some(number(name, value, 0.001, 10.0)?),
            "error" => self.error = Some(number(name, value, 1e-9, 1.0)?),
            "layers" => self.layers = Some(number(name, value, 2, 256)?),
            "merge" => self.merge = Some(number(name, value, 1, 64)?),
            "sides" => self.even_sides = Some(choice(name, value, [("even", true), ("adaptive", false)])?),
            "depth" => self.by_layer = Some(choice(name, value, [("layer", true), ("parallax", false)])?),
            "step" => self.step = Some(number(name, value, 1, 64)?),
            "verify" => self.verify = Some(number(name, value, 0, 8)?),
            "light-samples" => self.light_samples = Some(number(name, value, 1, 1024)?),
            "light-guide" => self.light_guide = Some(switch(name, value)?),
            "lobe-rays" => self.lobe_rays = Some(number(name, value, 1, 1024)?),
            "lobe-guide" => self.lobe_guide = Some(switch(name, value)?),
            "lobe-reuse" => self.lobe_reuse = Some(switch(name, value)?),
            "texture-alpha" => self.texture_alpha = Some(number(name, value, 0.0, 2.0)?),
            "photons" => self.photons = Some(number(name, value, 1, 100_000_000)?),
            "coverage" => self.rectangles = Some(choice(name, value, [("rect", true), ("quad", false)])?),
            "trail" => {
                let known =
                    [("all", Trails::All), ("silhouettes", Trails::Silhouettes), ("uncovered", Trails::Uncovered)];
                self.trails = Some(choice(name, value, known)?);
            }
            "weights" => self.count_bits = Some(choice(name, value, [("bits", true), ("areas", false)])?),
            "reach" => self.by_distance = Some(choice(name, value, [("distance", true), ("hessian", false)])?),
            "gradients" => self.gradients = Some(switch(name, value)?),
            "walls" => self.walls = Some(switch(name, value)?),
            "gaps" => self.gaps = Some(switch(name, value)?),
            "limit" => self.limit = Some(switch(name, value)?),
            "divide" => self.divide = Some(switch(name, value)?),
            "highlights" => self.highlights = Some(switch(name, value)?),
            "margins" => self.margins = Some(switch(name, value)?),
            "doubt" => self.doubt = Some(switch(name, value)?),
            "samples" => self.even_samples = Some(choice(name, value, [("even", true), ("adaptive", false)])?),
            "secondary" => {
                let kinds = [SecondaryKind::Cells, SecondaryKind::Photons, SecondaryKind::Paths];
                self.secondary = Some(choice(name, value, ["cells", "photons", "paths"].into_iter().zip(kinds))?);
            }
            _ => return Err(StudyError::Unknown(name.to_owned())),
        }
        Ok(())
    }

    /// Which texels become one element.
    pub(crate) fn merge_settings(&self) -> MergeSettings {
        let usual = MergeSettings::default();
        MergeSettings {
            max_side: self.merge.map_or(usual.max_side, |side| u8::try_from(side).unwrap_or(u8::MAX)),
            adaptive: self.even_sides != Some(true),
            depth: if self.by_layer == Some(true) { DepthRange::Layer } else { usual.depth },
            ..usual
        }
    }

    /// What an element covers.
    pub(crate) fn coverage(&self) -> Coverage {
        if self.rectangles == Some(true) { Coverage::Rectangle } else { Coverage::Quad }
    }

    /// How shares are measured.
    pub(crate) fn weights(&self) -> AreaWeights {
        if self.count_bits == Some(true) { AreaWeights::Bits } else { AreaWeights::Analytic }
    }
}

fn number<T: FromStr + PartialOrd + Display>(name: &str, value: &str, min: T, max: T) -> Result<T, StudyError> {
    match value.parse() {
        Ok(number) if number >= min && number <= max => Ok(number),
        _ => Err(refused(name, value, format!("a number from {min} to {max}"))),
    }
}

fn switch(name: &str, value: &str) -> Result<bool, StudyError> {
    choice(name, value, [("on", true), ("off", false)])
}

fn choice<T: Copy>(
    name: &str,
    value: &str,
    choices: impl IntoIterator<Item = (&'static str, T)>,
) -> Result<T, StudyError> {
    let choices: Vec<_> = choices.into_iter().collect();
    let found = choices.iter().find(|(word, _)| *word == value).map(|&(_, choice)| choice);
    let words: Vec<_> = choices.iter().map(|(word, _)| *word).collect();
    found.ok_or_else(|| refused(name, value, words.join(" or ")))
}

fn refused(name: &str, value: &str, expected: String) -> StudyError {
    StudyError::Value { name: name.to_owned(), value: value.to_owned(), expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_takes_a_value_and_refuses_nonsense() {
        let good = [
            ("resolution", "16"),
            ("spacing", "0.3"),
            ("error", "1e-6"),
            ("layers", "32"),
            ("merge", "1"),
            ("sides", "even"),
            ("depth", "layer"),
            ("step", "3"),
            ("verify", "0"),
            ("light-samples", "4"),
            ("light-guide", "off"),
            ("lobe-rays", "4"),
            ("lobe-guide", "off"),
            ("lobe-reuse", "off"),
            ("texture-alpha", "0.5"),
            ("photons", "1000"),
            ("coverage", "rect"),
            ("trail", "all"),
            ("weights", "bits"),
            ("reach", "distance"),
            ("gradients", "off"),
            ("walls", "off"),
            ("gaps", "off"),
            ("limit", "off"),
            ("divide", "off"),
            ("highlights", "off"),
            ("trail", "silhouettes"),
            ("margins", "off"),
            ("doubt", "off"),
            ("samples", "even"),
            ("secondary", "photons"),
        ];
        for (name, value) in good {
            let mut study = Study::default();
            assert_eq!(study.set(name, value), Ok(()), "{name}");
            assert_ne!(study, Study::default(), "{name} changes something");
            for nonsense in ["", "-1", "nan", "many", "1e99"] {
                let error = study.set(name, nonsense).unwrap_err().to_string();
                assert!(error.starts_with(name), "{error}");
            }
        }
        assert!(Study::default().set("speed", "9").unwrap_err().to_string().contains("speed"), "by name");
    }
}
