//! Reading by serde, from any format: the fields as they are found, and whether they make sense.
//!
//! The fields are listed a second time here, for what is derived on the types themselves would let them be read
//! unchecked.

use glam::{Vec2, Vec3};
use serde::de::Error;
use serde::{Deserialize, Deserializer};

use crate::outline::Outline;
use crate::{Elements, Record, Samples, Sides};

/// A record of which only the layout of its elements is checked.
#[derive(Deserialize)]
pub(crate) struct Unchecked(#[serde(with = "RecordFields")] pub(crate) Record);

#[derive(Deserialize)]
#[serde(remote = "Record")]
struct RecordFields {
    centre: Vec3,
    frame: [Vec3; 3],
    #[serde(with = "SamplesFields")]
    samples: Samples,
    elements: Elements,
    harmonic_distance: f32,
    radius: f32,
}

#[derive(Deserialize)]
#[serde(remote = "Samples")]
struct SamplesFields {
    n: u32,
    jitter: Vec<Vec2>,
    radiance: Vec<Vec3>,
    distance: Vec<f32>,
    normal: Vec<Vec3>,
    background_share: Vec<f32>,
    view_dependent: Vec<bool>,
}

#[derive(Deserialize)]
#[serde(remote = "Elements")]
struct ElementsFields {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    finite: Vec<f32>,
    background_share: Vec<f32>,
    radiance: [Vec<f32>; 3],
    start: Vec<[u8; 2]>,
    size: Vec<[u8; 2]>,
    sides: Vec<Sides>,
    view_dependent: Vec<bool>,
    layer_starts: Vec<u32>,
    #[serde(skip)]
    outline: Outline,
}

impl<'de> Deserialize<'de> for Record {
    /// Reads a record, and checks every length and number in it.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let record = RecordFields::deserialize(deserializer)?;
        check(&record).map_err(D::Error::custom)?;
        Ok(record)
    }
}

impl<'de> Deserialize<'de> for Samples {
    /// Reads the textures, and checks every length and number in them.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let samples = SamplesFields::deserialize(deserializer)?;
        check_samples(&samples).map_err(D::Error::custom)?;
        Ok(samples)
    }
}

impl<'de> Deserialize<'de> for Elements {
    /// Reads the arrays, and finds the outline by them.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut elements = ElementsFields::deserialize(deserializer)?;
        elements.check_layout().map_err(D::Error::custom)?;
        elements.outline = Outline::of(&elements);
        Ok(elements)
    }
}

/// Whether all of a record makes sense, or what does not.
pub(crate) fn check(record: &Record) -> Result<(), &'static str> {
    let ensure = |holds: bool, what| if holds { Ok(()) } else { Err(what) };
    ensure(record.centre.is_finite(), "its centre is not finite")?;
    let [s, t, n] = record.frame;
    let is_unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-3;
    let orthonormal = (s.cross(t) - n).length() < 1e-3 && [s, t, n].into_iter().all(is_unit);
    ensure(orthonormal, "its frame is not orthonormal")?;
    ensure(record.radius >= 0.0 && record.harmonic_distance >= 0.0, "its radius is negative or not a number")?;
    check_samples(&record.samples)?;
    check_elements(&record.elements, record.samples.resolution())
}

fn check_samples(samples: &Samples) -> Result<(), &'static str> {
    let n = samples.resolution();
    if !(1..=crate::MAX_RESOLUTION).contains(&n) {
        return Err("its resolution is not in 1..=64");
    }
    if !samples.has_all_texels() {
        return Err("a texture is not n x n");
    }
    if !samples.background_share.iter().all(|s| (0.0..=1.0).contains(s)) {
        return Err("a share is not in [0, 1]");
    }
    let is_known = |(normal, distance): (&Vec3, &f32)| normal.is_finite() || distance.is_infinite();
    let unit = |jitter: &Vec2| (0.0..=1.0).contains(&jitter.x) && (0.0..=1.0).contains(&jitter.y);
    let sane = samples.radiance.iter().all(|l| l.is_finite())
        && samples.distance.iter().all(|&d| d >= 0.0)
        && samples.normal.iter().zip(&samples.distance).all(is_known)
        && samples.jitter.iter().all(unit);
    if !sane {
        return Err("a texel is not finite");
    }
    Ok(())
}

fn check_elements(elements: &Elements, n: usize) -> Result<(), &'static str> {
    if elements.len() > n * n {
        return Err("it has more elements than texels");
    }
    let Elements { x, y, z, radiance, background_share, finite, .. } = elements;
    let floats = [x, y, z, background_share, finite].into_iter().chain(radiance);
    if !floats.flatten().all(|x| x.is_finite()) {
        return Err("an element is not finite");
    }
    if !elements.finite.iter().all(|&finite| finite == 0.0 || finite == 1.0) {
        return Err("an element is neither near nor at infinity");
    }
    if elements.size[elements.len()..].iter().any(|size| *size != [0; 2]) {
        return Err("its padding is not empty");
    }
    let mut covered = vec![false; n * n];
    for e in 0..elements.len() {
        let [i0, j0] = elements.start[e].map(usize::from);
        let [w, h] = elements.size[e].map(usize::from);
        if i0 + w > n || j0 + h > n {
            return Err("an element is outside the texture");
        }
        for texel in (j0..j0 + h).flat_map(|j| j * n + i0..j * n + i0 + w) {
            if std::mem::replace(&mut covered[texel], true) {
                return Err("its elements do not cover the texture once");
            }
        }
    }
    if covered.iter().all(|&c| c) { Ok(()) } else { Err("its elements do not cover the texture once") }
}
