//! A film as the bytes of an EXR or PNG file. The same film gives the same bytes, whatever the number of threads.

use std::collections::HashMap;
use std::io;

use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, Chromaticities, LineOrder, SampleType};
use exr::meta::header::Header;
use exr::prelude::{AttributeValue, Compression, LayerAttributes, Text, Vec2};
use glam::{UVec2, Vec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use integrator::{Film, Rungs};
use rayon::prelude::*;

use crate::failure::Failure;
use crate::files::Sink;

/// Primaries and white of linear sRGB (Rec. 709, D65).
const SRGB: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// A term of the picture, see [`Film`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
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
    /// The command with all that decides the picture, as it was given, and nothing else.
    pub(crate) command: &'a str,
    /// The seed.
    pub(crate) seed: u64,
}

/// Where the samples of a channel come from.
#[derive(Debug, Clone, Copy)]
enum Source<'a> {
    /// An axis of each vector.
    Axis(&'a [Vec3], usize),
    /// Each number.
    Plain(&'a [f32]),
    /// A number of each of these, by its place in [`Rungs::NAMES`].
    Rung(&'a [Rungs], usize),
}

impl Source<'_> {
    fn sample(self, pixel: usize) -> f32 {
        match self {
            Self::Axis(vectors, axis) => vectors[pixel][axis],
            Self::Plain(numbers) => numbers[pixel],
            Self::Rung(rungs, number) => rungs[pixel].to_array()[number],
        }
    }
}

/// Channels of the three axes of some vectors.
fn three<'a>(prefix: &str, names: [&str; 3], vectors: &'a [Vec3]) -> Vec<(String, Source<'a>)> {
    let names = names.into_iter().enumerate();
    names.map(|(axis, name)| (format!("{prefix}{name}"), Source::Axis(vectors, axis))).collect()
}

const RGB: [&str; 3] = ["R", "G", "B"];

/// Writes one part of float32 with ZIP: `picture` as R, G, B with A, linear and unclamped. Where the picture is the
/// whole one and not a `term`, the terms, albedo, normal (world space) and depth (metres along the ray) follow, and the
/// rungs and the estimated relative `error` where there are such.
pub(crate) fn exr(
    film: &Film,
    picture: &[Vec3],
    term: Option<Term>,
    error: Option<&[f32]>,
    origin: &Origin,
    out: &mut dyn Sink,
) -> io::Result<()> {
    let mut channels = three("", RGB, picture);
    channels.push(("A".to_owned(), Source::Plain(&film.alpha)));
    if term.is_none() {
        for term in Term::ALL {
            channels.extend(three(&format!("{}.", term.name()), RGB, term.of(film)));
        }
        channels.extend(three("albedo.", RGB, &film.albedo));
        channels.extend(three("normal.", ["X", "Y", "Z"], &film.normal));
        channels.push(("depth.Z".to_owned(), Source::Plain(&film.depth)));
        if let Some(rungs) = &film.rungs {
            let names = Rungs::NAMES.into_iter().enumerate();
            channels.extend(names.map(|(number, name)| (format!("rung.{name}"), Source::Rung(rungs, number))));
        }
        channels.extend(error.map(|error| ("error.Y".to_owned(), Source::Plain(error))));
    }
    // Attributes of one's own are kept in hash maps of random order: one in each of the two keeps the bytes the same.
    let attributes = LayerAttributes {
        software_name: Some(latin1(concat!("freelux ", env!("CARGO_PKG_VERSION")))),
        other: [(Text::from("freelux:seed"), AttributeValue::Text(latin1(&origin.seed.to_string())))].into(),
        ..LayerAttributes::default()
    };
    let command = [(Text::from("freelux:command"), AttributeValue::Text(latin1(origin.command)))].into();
    write_exr(film.size, channels, attributes, command, out)
}

/// Writes a picture of float32 with ZIP that is nothing but R, G and B, linear.
pub(crate) fn plain_exr(size: UVec2, picture: &[Vec3], out: &mut dyn Sink) -> io::Result<()> {
    write_exr(size, three("", RGB, picture), LayerAttributes::default(), HashMap::default(), out)
}

/// Blocks of 16 rows that are compressed at once: enough for all threads, and a bound on the memory.
const BLOCKS_AT_ONCE: usize = 32;

/// Writes the channels block by block, so that no channel is ever copied as a whole.
fn write_exr(
    size: UVec2,
    mut channels: Vec<(String, Source)>,
    attributes: LayerAttributes,
    of_picture: HashMap<Text, AttributeValue>,
    out: &mut dyn Sink,
) -> io::Result<()> {
    // The format wants them by their names.
    channels.sort_by(|(a, _), (b, _)| a.cmp(b));
    let width = size.x as usize;
    let described = channels.iter().map(|(name, _)| ChannelDescription::new(name.as_str(), SampleType::F32, true));
    let mut header = Header::new(Text::from(""), (width, size.y as usize), described.collect()).with_encoding(
        Compression::ZIP16,
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    );
    header.own_attributes = attributes;
    header.shared_attributes.chromaticities = Some(SRGB);
    header.shared_attributes.other = of_picture;
    let written = exr::block::write(out, std::iter::once(header).collect(), true, |meta, writer| {
        let blocks: Vec<_> = exr::block::enumerate_ordered_header_block_indices(&meta.headers).collect();
        for blocks in blocks.chunks(BLOCKS_AT_ONCE) {
            let compress = |&(number, index): &(usize, BlockIndex)| {
                let block = UncompressedBlock::from_lines(&meta.headers[0].channels, index, |line| {
                    let (source, start) = (channels[line.location.channel].1, line.location.position);
                    let first = start.y() * width + start.x();
                    line.write_samples(|x| source.sample(first + x)).expect("a line of the block into memory");
                });
                block.compress_to_chunk(&meta.headers).map(|chunk| (number, chunk))
            };
            let chunks: Vec<_> = blocks.par_iter().map(compress).collect();
            for chunk in chunks {
                let (number, chunk) = chunk?;
                writer.write_chunk(number, chunk)?;
            }
        }
        Ok(())
    });
    written.map_err(|error| match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    })
}

/// Encodes a picture for a display: multiplied by 2^`exposure`, clamped to [0, 1], then the sRGB curve, 8 bits. Nothing
/// bends the tones in between, so that equal light stays equal; NaN is black.
pub(crate) fn png(size: UVec2, picture: &[Vec3], exposure: f32) -> Result<Vec<u8>, Failure> {
    let factor = exposure.exp2();
    let codes: Vec<[u8; 3]> = picture.iter().map(|pixel| srgb_codes(*pixel * factor)).collect();
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

/// Encodes linear light where 1 is white, clamped.
pub(crate) fn srgb_codes(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(srgb_code)
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
    use std::io::Cursor;
    use std::path::Path;

    use scene::{Picture, PictureFormat};

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
    fn an_exr_comes_back_bit_for_bit() {
        let mut film = Film::new(UVec2::new(3, 2));
        film.direct[4] = Vec3::new(-1.5, 1e20, 1e-20);
        film.emitted[1] = Vec3::new(f32::NAN, f32::INFINITY, 0.25);
        let origin = Origin { command: "freelux render", seed: 3 };
        let encoded = || {
            let mut bytes = Cursor::new(Vec::new());
            exr(&film, &film.picture(), None, None, &origin, &mut bytes).unwrap();
            bytes.into_inner()
        };
        let bytes = encoded();
        let picture = Picture::decode(Path::new("a.exr"), &bytes).unwrap();
        assert_eq!((picture.size, picture.format), (film.size, PictureFormat::Exr), "size and format");
        let bits = |pixels: &[Vec3]| pixels.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&picture.pixels), bits(&film.picture()), "negative and broken values too");
        assert_eq!(bytes, encoded(), "the same bytes again");
    }

    #[test]
    fn text_of_other_scripts_is_kept_readable() {
        assert_eq!(latin1("a\u{e4}\u{4e16}b").to_string(), "a\u{e4}?b", "one byte a letter");
    }
}
