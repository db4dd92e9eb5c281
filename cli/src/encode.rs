//! A film as the bytes of an EXR or PNG file. The same film gives the same bytes, whatever the number of threads.

use std::io::Cursor;

use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, Vec2,
    WritableImage,
};
use glam::{UVec2, Vec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use integrator::Film;

use crate::failure::Failure;

/// Primaries and white of linear sRGB (Rec. 709, D65).
const SRGB: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// A term of the picture, see [`Film`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Term {
    /// Light seen directly.
    Emitted,
    /// Light that comes straight from a light.
    Direct,
    /// Everything else by the specular part of the surface.
    Specular,
    /// Light that comes by mirrors and glass alone, on the diffuse part.
    Caustic,
    /// Everything else on the diffuse part.
    Indirect,
}

impl Term {
    const ALL: [Self; 5] = [Self::Emitted, Self::Direct, Self::Specular, Self::Caustic, Self::Indirect];

    /// The name in channels and on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Emitted => "emitted",
            Self::Direct => "direct",
            Self::Specular => "specular",
            Self::Caustic => "caustic",
            Self::Indirect => "indirect",
        }
    }

    /// The pixels of this term.
    pub(crate) fn of(self, film: &Film) -> &[Vec3] {
        match self {
            Self::Emitted => &film.emitted,
            Self::Direct => &film.direct,
            Self::Specular => &film.specular,
            Self::Caustic => &film.caustic,
            Self::Indirect => &film.indirect,
        }
    }
}

/// What an EXR tells about its making.
#[derive(Debug)]
pub(crate) struct Origin<'a> {
    /// The command with all that changes the picture, and nothing that does not.
    pub(crate) command: &'a str,
    /// The seed.
    pub(crate) seed: u64,
}

/// Encodes one part of float32 with ZIP: `picture` as R, G, B with A, linear and unclamped. Where the picture is the
/// whole one and not a `term`, the terms, albedo, normal (world space) and depth (metres along the ray) follow.
pub(crate) fn exr(film: &Film, picture: &[Vec3], term: Option<Term>, origin: &Origin) -> Result<Vec<u8>, Failure> {
    let mut channels = Vec::new();
    let mut add = |name: &str, samples: Vec<f32>| {
        channels.push(AnyChannel::new(name, FlatSamples::F32(samples)));
    };
    let mut add_three = |prefix: &str, names: [&str; 3], pixels: &[Vec3]| {
        for (axis, name) in names.into_iter().enumerate() {
            add(&format!("{prefix}{name}"), pixels.iter().map(|pixel| pixel[axis]).collect());
        }
    };
    let rgb = ["R", "G", "B"];
    add_three("", rgb, picture);
    if term.is_none() {
        for term in Term::ALL {
            add_three(&format!("{}.", term.name()), rgb, term.of(film));
        }
        add_three("albedo.", rgb, &film.albedo);
        add_three("normal.", ["X", "Y", "Z"], &film.normal);
        add("depth.Z", film.depth.clone());
    }
    add("A", film.alpha.clone());

    // Attributes of one's own are kept in hash maps of random order: one in each of the two keeps the bytes the same.
    let attributes = LayerAttributes {
        software_name: Some(latin1(concat!("freelux ", env!("CARGO_PKG_VERSION")))),
        other: [(Text::from("freelux:seed"), AttributeValue::Text(latin1(&origin.seed.to_string())))].into(),
        ..LayerAttributes::default()
    };
    let size = (film.size.x as usize, film.size.y as usize);
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let mut image = Image::from_layer(Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels));
    image.attributes.chromaticities = Some(SRGB);
    image.attributes.other = [(Text::from("freelux:command"), AttributeValue::Text(latin1(origin.command)))].into();

    let mut bytes = Cursor::new(Vec::new());
    image
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| Failure::Run(format!("the EXR cannot be encoded: {error}")))?;
    Ok(bytes.into_inner())
}

/// Encodes a picture of float32 with ZIP that is nothing but R, G and B, linear.
pub(crate) fn plain_exr(size: UVec2, picture: &[Vec3]) -> Result<Vec<u8>, Failure> {
    let names = ["R", "G", "B"].into_iter().enumerate();
    let channels = names
        .map(|(axis, name)| AnyChannel::new(name, FlatSamples::F32(picture.iter().map(|pixel| pixel[axis]).collect())));
    let channels = AnyChannels::sort(channels.collect());
    let size = (size.x as usize, size.y as usize);
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| Failure::Run(format!("the EXR cannot be encoded: {error}")))?;
    Ok(bytes.into_inner())
}

/// Encodes a picture for a display: multiplied by 2^`exposure`, clamped to [0, 1], then the sRGB curve, 8 bits. Nothing
/// bends the tones in between, so that equal light stays equal; NaN is black.
pub(crate) fn png(size: UVec2, picture: &[Vec3], exposure: f32) -> Result<Vec<u8>, Failure> {
    let factor = exposure.exp2();
    let codes: Vec<[u8; 3]> = picture.iter().map(|pixel| (*pixel * factor).to_array().map(srgb_code)).collect();
    png_of_codes(size, &codes)
}

/// Encodes a picture of 8-bit sRGB codes.
pub(crate) fn png_of_codes(size: UVec2, codes: &[[u8; 3]]) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(codes.as_flattened(), size.x, size.y, ExtendedColorType::Rgb8)
        .map_err(|error| Failure::Run(format!("the PNG cannot be encoded: {error}")))?;
    Ok(bytes)
}

/// The sRGB curve (IEC 61966-2-1) in 8 bits, rounded to the nearest code.
fn srgb_code(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 255; NaN becomes 0")]
    let code = (255.0 * encoded + 0.5) as u8;
    code
}

/// EXR's text has one byte a letter.
fn latin1(text: &str) -> Text {
    let text: String = text.chars().map(|c| if u32::from(c) < 256 { c } else { '?' }).collect();
    Text::new_or_none(&text).unwrap_or_else(|| Text::from("?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_codes_by_hand() {
        let codes = [0.0, 1.0, 7.0, -3.0, f32::NAN, 0.214_041_14, 0.002].map(srgb_code);
        assert_eq!(codes, [0, 255, 255, 0, 0, 128, 7], "black, white, clamped, NaN, middle grey, the straight part");
    }

    #[test]
    fn exposure_is_in_stops() {
        let picture = [Vec3::splat(0.25), Vec3::new(4.0, 0.0, f32::NAN)];
        let size = UVec2::new(2, 1);
        let decoded = |stops| image::load_from_memory(&png(size, &picture, stops).unwrap()).unwrap().into_rgb8();
        assert_eq!(decoded(2.0).get_pixel(0, 0).0, [255; 3], "two stops are four times");
        assert_eq!(decoded(0.0).get_pixel(1, 0).0, [255, 0, 0], "a pixel too bright and not a number");
    }

    #[test]
    fn text_of_other_scripts_is_kept_readable() {
        assert_eq!(latin1("a\u{e4}\u{4e16}b").to_string(), "a\u{e4}?b", "one byte a letter");
    }
}
