//! Pictures as `compare` and `info` read them: every value as the file has it, NaN and negative ones included, so that
//! nothing is mended before it is measured. (Textures and surroundings are read by the scene crate, which mends.)

use std::fmt::Display;
use std::fs;
use std::io::{Cursor, Read};
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::{Compression, ReadChannels, ReadLayers, read as exr_reader};
use glam::{UVec2, Vec3};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use scene::limits;

use crate::failure::Failure;

/// A picture in memory.
#[derive(Debug)]
pub(crate) struct Picture {
    /// Width and height.
    pub(crate) size: UVec2,
    /// Linear RGB, rows from the top; 8-bit and 16-bit codes are decoded by the sRGB curve.
    pub(crate) pixels: Vec<Vec3>,
    /// What kind of file it was.
    pub(crate) format: Format,
}

/// The kinds of pictures that are read, told apart by content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    /// OpenEXR.
    Exr,
    /// Radiance HDR.
    Hdr,
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
}

impl Format {
    /// Returns the format that the first bytes of a file tell.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            return Some(Self::Exr);
        }
        match image::guess_format(bytes).ok()? {
            ImageFormat::Hdr => Some(Self::Hdr),
            ImageFormat::Png => Some(Self::Png),
            ImageFormat::Jpeg => Some(Self::Jpeg),
            _ => None,
        }
    }

    /// Whether the file holds codes for a display, already exposed, and not light.
    pub(crate) fn is_coded(self) -> bool {
        matches!(self, Self::Png | Self::Jpeg)
    }

    /// The name for messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Exr => "OpenEXR",
            Self::Hdr => "Radiance HDR",
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
        }
    }
}

/// Reads a whole regular file within the limits.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    let failed = |error| refuse(path, format!("cannot be read: {error}"), "correct the name or the rights");
    // The kind is asked before opening: opening a pipe would wait for its writer.
    let metadata = fs::metadata(path).map_err(failed)?;
    if !metadata.is_file() {
        return Err(refuse(path, "is not a regular file", "name a file, not a folder, pipe or device"));
    }
    if metadata.len() > limits::FILE_BYTES {
        let what = format!("has {} bytes, more than the limit of {}", metadata.len(), limits::FILE_BYTES);
        return Err(refuse(path, what, "shrink it"));
    }
    let mut bytes = Vec::new();
    // A file that grows while it is read still stops at the limit.
    let file = fs::File::open(path).map_err(failed)?;
    file.take(limits::FILE_BYTES).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// Reads a picture from a file.
pub(crate) fn read(path: &Path) -> Result<Picture, Failure> {
    decode(path, &read_file(path)?)
}

/// Decodes a picture whose file is in memory; `path` is for messages.
pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Picture, Failure> {
    match Format::of(bytes) {
        Some(Format::Exr) => decode_exr(path, bytes),
        Some(format) => decode_other(path, bytes, format),
        None => {
            let what = "is neither EXR, HDR, PNG nor JPEG by its first bytes";
            Err(refuse(path, what, "convert it to one of these"))
        }
    }
}

/// Reads the header of an EXR and checks all that it asks for.
pub(crate) fn exr_meta(path: &Path, bytes: &[u8]) -> Result<MetaData, Failure> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| damaged(path, &error))?;
    for header in &meta.headers {
        let size = header.layer_size;
        let samples = header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample() as u64);
        // Twelve bytes a pixel are ours, whatever the file holds.
        check_size(path, size.width() as u64, size.height() as u64, samples.sum::<u64>().max(12), bytes.len())?;
        if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
            return Err(refuse(
                path,
                format!("{} compression is not supported", header.compression),
                "save it with ZIP",
            ));
        }
    }
    Ok(meta)
}

fn decode_exr(path: &Path, bytes: &[u8]) -> Result<Picture, Failure> {
    let meta = exr_meta(path, bytes)?;
    if !has_rgb(&meta) {
        let names =
            meta.headers.iter().flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
        let names: Vec<String> = names.take(12).collect();
        let what = format!("has no flat channels R, G and B, but {}", names.join(", "));
        return Err(refuse(path, what, "save it as a flat EXR in RGB"));
    }
    let image = exr_reader()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![Vec3::ZERO; size.area()]),
            |(width, pixels): &mut (usize, Vec<Vec3>), position, (r, g, b): (f32, f32, f32)| {
                pixels[position.y() * *width + position.x()] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        // A fault in the decoder stays in this thread.
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| damaged(path, &error))?;
    let size = image.layer_data.size;
    let side = |n: usize| u32::try_from(n).map_err(|_| refuse(path, "has a side beyond 32 bits", "shrink it"));
    let size = UVec2::new(side(size.width())?, side(size.height())?);
    Ok(Picture { size, pixels: image.layer_data.channel_data.pixels.1, format: Format::Exr })
}

/// Whether a part can be read as a picture.
pub(crate) fn has_rgb(meta: &MetaData) -> bool {
    meta.headers.iter().filter(|header| !header.deep).any(|header| {
        ["R", "G", "B"].iter().all(|&name| header.channels.list.iter().any(|channel| channel.name.eq(name)))
    })
}

fn decode_other(path: &Path, bytes: &[u8], format: Format) -> Result<Picture, Failure> {
    let mut reader = ImageReader::with_format(
        Cursor::new(bytes),
        match format {
            Format::Png => ImageFormat::Png,
            Format::Jpeg => ImageFormat::Jpeg,
            _ => ImageFormat::Hdr,
        },
    );
    let mut allocation = image::Limits::default();
    allocation.max_alloc = Some(limits::PIXELS * 16);
    reader.limits(allocation);
    let decoder = reader.into_decoder().map_err(|error| damaged(path, &error))?;
    let (width, height) = decoder.dimensions();
    check_size(path, width.into(), height.into(), decoder.color_type().bytes_per_pixel().into(), bytes.len())?;
    let picture = DynamicImage::from_decoder(decoder).map_err(|error| damaged(path, &error))?;
    let coded = format.is_coded();
    let linear = |value: f32| if coded { linear_from_srgb(value) } else { value };
    // Codes of 8 and 16 bits become shares of 1.
    let pixels = picture.into_rgb32f().pixels().map(|pixel| Vec3::from_array(pixel.0.map(linear))).collect();
    Ok(Picture { size: UVec2::new(width, height), pixels, format })
}

/// Refuses a size beyond the limits before memory is taken for it. `unpacked` is the bytes that decoding takes a pixel.
fn check_size(path: &Path, width: u64, height: u64, unpacked: u64, packed: usize) -> Result<(), Failure> {
    let pixels = width.saturating_mul(height);
    if pixels == 0 || pixels > limits::PIXELS {
        let what = format!("has {width} x {height} pixels, which is not between 1 and {}", limits::PIXELS);
        return Err(refuse(path, what, "give another picture"));
    }
    if pixels.saturating_mul(unpacked) > limits::UNPACKED_BYTES + limits::UNPACKED_RATIO * packed as u64 {
        let what = format!("{width} x {height} pixels in {packed} bytes cannot be true");
        return Err(refuse(path, what, "get the file again"));
    }
    Ok(())
}

/// The inverse of the sRGB curve (IEC 61966-2-1).
fn linear_from_srgb(code: f32) -> f32 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

fn damaged(path: &Path, error: &dyn Display) -> Failure {
    refuse(path, format!("is damaged or not supported: {error}"), "get the file again")
}

fn refuse(path: &Path, what: impl Display, advice: &str) -> Failure {
    Failure::Input(format!("{}: {what}; {advice}", path.display()))
}

#[cfg(test)]
mod tests {
    use integrator::Film;

    use super::*;
    use crate::encode::{self, Origin};

    #[test]
    fn an_exr_comes_back_bit_for_bit() {
        let mut film = Film::new(UVec2::new(3, 2));
        film.direct[4] = Vec3::new(-1.5, 1e20, 1e-20);
        film.emitted[1] = Vec3::new(f32::NAN, f32::INFINITY, 0.25);
        let origin = Origin { command: "freelux render", seed: 3 };
        let encoded = || {
            let mut bytes = Cursor::new(Vec::new());
            encode::exr(&film, &film.picture(), None, None, &origin, &mut bytes).unwrap();
            bytes.into_inner()
        };
        let bytes = encoded();
        let picture = decode(Path::new("a.exr"), &bytes).unwrap();
        assert_eq!((picture.size, picture.format), (film.size, Format::Exr), "size and format");
        let bits = |pixels: &[Vec3]| pixels.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&picture.pixels), bits(&film.picture()), "negative and broken values too");
        assert_eq!(bytes, encoded(), "the same bytes again");
    }

    #[test]
    fn codes_of_8_and_16_bits_mean_the_same_light() {
        let encoded = |picture: DynamicImage| {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
            decode(Path::new("a.png"), bytes.get_ref()).unwrap().pixels[0].x
        };
        let eight = encoded(image::GrayImage::from_pixel(1, 1, image::Luma([128])).into());
        let sixteen =
            encoded(DynamicImage::ImageLuma16(image::ImageBuffer::from_pixel(1, 1, image::Luma([128 * 257]))));
        assert!((eight - 0.215_861).abs() < 1e-5, "code 128 is {eight}");
        assert!((eight - sixteen).abs() < 1e-6, "{eight} and {sixteen}");
    }

    #[test]
    fn sizes_are_refused_before_memory_is_taken() {
        let size = |width, height, packed| check_size(Path::new("a"), width, height, 12, packed).is_ok();
        assert!(size(1, 1, 60) && size(16_384, 16_384, 1 << 20), "one pixel, and as many as may be");
        assert!(!size(0, 7, 60) && !size(16_385, 16_384, 1 << 20), "none, and more than may be");
        assert!(!size(16_384, 16_384, 355) && !size(u64::MAX, u64::MAX, 60), "a bomb, and no overflow");
    }

    #[test]
    fn other_files_are_refused_by_name() {
        for bytes in [&b""[..], b"hello", b"GIF89a", b"\x89PNG\r\n\x1a\n", b"#?RADIANCE\n\n-Y 1 +X 0\n", b"v/1\x01"] {
            let Err(Failure::Input(line)) = decode(Path::new("a.bin"), bytes) else {
                panic!("{bytes:?} is no picture");
            };
            assert!(line.starts_with("a.bin: ") && line.contains("; "), "{line}");
        }
    }
}
