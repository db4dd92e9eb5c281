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
    /// Texels along a side of the block that a hole ray stands for at most, 1 to 64: points with few holes take smaller
    /// ones.
    pub step: Option<u32>,
    /// Verification rays along a side, 0 to 8; 0 verifies nothing.
    pub verify: Option<u32>,
    /// Light samples a primary sample, 1 to 1024.
    pub light_samples: Option<u32>,
    /// Whether lights are chosen by what was found beforehand to reach what the picture and its paths show.
    pub light_guide: Option<bool>,
    /// Whether gathers, and links of cells, look more often where light was found to come from few directions.
    pub gather_guide: Option<bool>,
    /// Rays through a traced glossy lobe for each primary sample, 1 to 1024; a lobe that is narrow or dim takes fewer.
    pub lobe_rays: Option<u32>,
    /// Whether half of the rays of wide lobes go where light was found beforehand.
    pub lobe_guide: Option<bool>,
    /// Whether neighbours share what the rays of their lobes find.
    pub lobe_reuse: Option<bool>,
    /// Roughness (alpha of GGX) from which on a glossy lobe without a diffuse part reads a texture instead of being
    /// traced, 0 to 2; never where a texture is too coarse.
    pub texture_alpha: Option<f32>,
    /// Photons to shoot into each map that the scene needs, 1 to 10^8.
    pub photons: Option<u32>,
    /// Whether elements cover the rectangle around their corners, as in the paper, or their quadrilateral.
    pub rectangles: Option<bool>,
    /// What leaves trails, and how long ones; all elements do in the paper.
    pub trails: Option<Trails>,
    /// Whether shares are counted in bits or measured as areas.
    pub count_bits: Option<bool>,
    /// Whether records of irradiance reach a share of the harmonic mean distance (Ward 1988), or as far as the Hessian
    /// says.
    pub by_distance: Option<bool>,
    /// Whether records of irradiance know its gradients.
    pub gradients: Option<bool>,
    /// Whether records of irradiance stop at walls that they met near their horizon.
    pub walls: Option<bool>,
    /// Whether records of irradiance reach no farther than their neighbours and the way to these.
    pub clamp: Option<bool>,
    /// Whether thin gaps take records of irradiance of their own.
    pub gaps: Option<bool>,
    /// Whether records reach no farther than a quarter of the scene and of what the picture shows there.
    pub limit: Option<bool>,
    /// Whether texels of a gather between bright and dark, and at the rim of the sky, are divided.
    pub divide: Option<bool>,
    /// Whether pixels ask which lights nothing hides, and trace no shadow rays to these.
    pub clear_lights: Option<bool>,
    /// Whether direct light in half shadows is fitted over neighbouring pixels.
    pub direct_fit: Option<bool>,
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

/// What a setting takes, and where it is kept.
enum Kind {
    /// A whole number in a range.
    Whole(fn(&mut Study) -> &mut Option<u32>, u32, u32),
    /// A number in a range.
    Real(fn(&mut Study) -> &mut Option<f32>, f32, f32),
    /// One of two words: what is kept is whether it is the first.
    Either(fn(&mut Study) -> &mut Option<bool>, &'static str, &'static str),
    /// What leaves trails.
    Trails,
    /// Where gather rays take light from.
    Secondary,
}

use Kind::{Either, Real, Whole};

/// The setting is on or off.
const fn switch(place: fn(&mut Study) -> &mut Option<bool>) -> Kind {
    Either(place, "on", "off")
}

/// All settings, by the names that the command line writes.
const SETTINGS: [(&str, Kind); 34] = [
    ("resolution", Whole(|study| &mut study.resolution, 1, 64)),
    ("spacing", Real(|study| &mut study.spacing, 0.001, 10.0)),
    ("error", Real(|study| &mut study.error, 1e-9, 1.0)),
    ("layers", Whole(|study| &mut study.layers, 2, 256)),
    ("merge", Whole(|study| &mut study.merge, 1, 64)),
    ("sides", Either(|study| &mut study.even_sides, "even", "adaptive")),
    ("depth", Either(|study| &mut study.by_layer, "layer", "parallax")),
    ("step", Whole(|study| &mut study.step, 1, 64)),
    ("verify", Whole(|study| &mut study.verify, 0, 8)),
    ("light-samples", Whole(|study| &mut study.light_samples, 1, 1024)),
    ("light-guide", switch(|study| &mut study.light_guide)),
    ("clear-lights", switch(|study| &mut study.clear_lights)),
    ("direct-fit", switch(|study| &mut study.direct_fit)),
    ("gather-guide", switch(|study| &mut study.gather_guide)),
    ("lobe-rays", Whole(|study| &mut study.lobe_rays, 1, 1024)),
    ("lobe-guide", switch(|study| &mut study.lobe_guide)),
    ("lobe-reuse", switch(|study| &mut study.lobe_reuse)),
    ("texture-alpha", Real(|study| &mut study.texture_alpha, 0.0, 2.0)),
    ("photons", Whole(|study| &mut study.photons, 1, 100_000_000)),
    ("coverage", Either(|study| &mut study.rectangles, "rect", "quad")),
    ("trail", Kind::Trails),
    ("weights", Either(|study| &mut study.count_bits, "bits", "areas")),
    ("reach", Either(|study| &mut study.by_distance, "distance", "hessian")),
    ("gradients", switch(|study| &mut study.gradients)),
    ("walls", switch(|study| &mut study.walls)),
    ("clamp", switch(|study| &mut study.clamp)),
    ("gaps", switch(|study| &mut study.gaps)),
    ("limit", switch(|study| &mut study.limit)),
    ("divide", switch(|study| &mut study.divide)),
    ("highlights", switch(|study| &mut study.highlights)),
    ("margins", switch(|study| &mut study.margins)),
    ("doubt", switch(|study| &mut study.doubt)),
    ("samples", Either(|study| &mut study.even_samples, "even", "adaptive")),
    ("secondary", Kind::Secondary),
];

/// A setting for study that does not exist or is out of its range.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// No setting of this name.
    #[error("{0}: there is no such setting; it is one of {names}", names = Study::names().collect::<Vec<_>>().join(", "))]
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
    /// Returns the names of all settings, as [`Self::set`] takes them.
    pub fn names() -> impl Iterator<Item = &'static str> {
        SETTINGS.iter().map(|(name, _)| *name)
    }

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
        let setting = SETTINGS.iter().find(|(known, _)| *known == name);
        let (name, kind) = setting.ok_or_else(|| StudyError::Unknown(name.to_owned()))?;
        match *kind {
            Whole(place, min, max) => *place(self) = Some(number(name, value, min, max)?),
            Real(place, min, max) => *place(self) = Some(number(name, value, min, max)?),
            Either(place, first, second) => {
                *place(self) = Some(choice(name, value, [(first, true), (second, false)])?);
            }
            Kind::Trails => {
                let known =
                    [("all", Trails::All), ("silhouettes", Trails::Silhouettes), ("uncovered", Trails::Uncovered)];
                self.trails = Some(choice(name, value, known)?);
            }
            Kind::Secondary => {
                let kinds = [
                    ("cells", SecondaryKind::Cells),
                    ("photons", SecondaryKind::Photons),
                    ("paths", SecondaryKind::Paths),
                ];
                self.secondary = Some(choice(name, value, kinds)?);
            }
        }
        Ok(())
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// The first that is out of its range, by name.
    pub fn validate(&self) -> Result<(), StudyError> {
        let mut study = *self;
        for (name, kind) in &SETTINGS {
            match *kind {
                Whole(place, min, max) => is_within(name, *place(&mut study), min, max)?,
                Real(place, min, max) => is_within(name, *place(&mut study), min, max)?,
                Either(..) | Kind::Trails | Kind::Secondary => {}
            }
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

fn is_within<T: PartialOrd + Display>(name: &str, value: Option<T>, min: T, max: T) -> Result<(), StudyError> {
    match value {
        // Written so that NaN is refused.
        Some(value) if !(value >= min && value <= max) => {
            Err(refused(name, &value.to_string(), format!("a number from {min} to {max}")))
        }
        _ => Ok(()),
    }
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
    use crate::Settings;

    #[test]
    fn every_setting_takes_a_value_and_refuses_nonsense() {
        let text = |kind: &Kind| match *kind {
            Whole(_, min, max) => [min.to_string(), max.to_string()],
            Real(_, min, max) => [min.to_string(), max.to_string()],
            Either(_, first, second) => [first.to_owned(), second.to_owned()],
            Kind::Trails => ["all".to_owned(), "uncovered".to_owned()],
            Kind::Secondary => ["photons".to_owned(), "paths".to_owned()],
        };
        let good = SETTINGS.iter().flat_map(|(name, kind)| text(kind).map(|value| (*name, value)));
        for (name, value) in good {
            let mut study = Study::default();
            assert_eq!(study.set(name, &value), Ok(()), "{name} {value}");
            assert_ne!(study, Study::default(), "{name} changes something");
            assert_eq!(study.validate(), Ok(()), "{name} {value}");
            for nonsense in ["", "-1", "nan", "many", "1e99"] {
                let error = study.set(name, nonsense).unwrap_err().to_string();
                assert!(error.starts_with(name), "{error}");
            }
        }
        let unknown = Study::default().set("speed", "9").unwrap_err().to_string();
        assert!(unknown.contains("speed") && Study::names().all(|name| unknown.contains(name)), "{unknown}");
    }

    #[test]
    fn fields_out_of_their_ranges_are_refused_by_name() {
        for (study, name) in [
            (Study { resolution: Some(100), ..Study::default() }, "resolution 100"),
            (Study { light_samples: Some(0), ..Study::default() }, "light-samples 0"),
            (Study { spacing: Some(f32::NAN), ..Study::default() }, "spacing NaN"),
        ] {
            let settings = Settings { study, ..Settings::default() };
            let error = settings.validate().unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
