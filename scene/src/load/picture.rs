//! Pictures: PNG, JPEG and HDR by the `image` crate, EXR by [`super::picture_exr`], told apart by content.

use std::io::Cursor;
use std::path::Path;

use glam::{UVec2, Vec3};
use image::codecs::hdr::{HdrDecoder, HdrMetadata};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::error::{LoadError, Place};
use super::files::Files;
use super::picture_exr::{self, ExrPicture};
use super::warnings::Warnings;
use super::{limits, read_file};
use crate::srgb::linear_from_srgb;

/// A picture as its file has it (an EXR within its display window, a Radiance picture as radiance, without its
/// exposure), NaN, infinite and negative values included: for whoever measures pictures. Those that scenes name are
/// mended.
///
/// # Example
///
/// ```
/// use std::path::Path;
///
/// use scene::glam::{UVec2, Vec3};
/// use scene::{Picture, PictureFormat};
///
/// // One pixel, as a file would hold it.
/// let bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x40\x00\x81";
/// let picture = Picture::decode(Path::new("dot.hdr"), bytes)?;
/// assert_eq!((picture.size, picture.format), (UVec2::ONE, PictureFormat::Hdr));
/// assert_eq!(picture.pixels, [Vec3::new(1.0, 0.5, 0.0)]);
/// # Ok::<(), scene::LoadError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width and height.
    pub size: UVec2,
    /// Linear RGB, rows from the top; 8-bit and 16-bit codes are decoded by the sRGB curve.
    pub pixels: Vec<Vec3>,
    /// What kind of file it was.
    pub format: PictureFormat,
}

/// The kinds of pictures that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// `OpenEXR`.
    Exr,
    /// Radiance HDR.
    Hdr,
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
}

impl PictureFormat {
    /// Returns the format that the first bytes of a file tell.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            return Some(Self::Exr);
        }
        if bytes.starts_with(OTHER_HDR) {
            return Some(Self::Hdr);
        }
        match image::guess_format(bytes).ok()? {
            ImageFormat::Hdr => Some(Self::Hdr),
            ImageFormat::Png => Some(Self::Png),
            ImageFormat::Jpeg => Some(Self::Jpeg),
            _ => None,
        }
    }

    /// Whether the file holds codes for a display, already exposed, and not light.
    #[must_use]
    pub fn is_coded(self) -> bool {
        matches!(self, Self::Png | Self::Jpeg)
    }

    /// Returns the name for messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exr => "OpenEXR",
            Self::Hdr => "Radiance HDR",
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
        }
    }
}

impl Picture {
    /// Reads a picture from a file.
    ///
    /// # Errors
    /// The file cannot be read, is larger than the [`limits`], is damaged, or is no picture that is known.
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        Self::decode(path, &read_file(path)?)
    }

    /// Decodes a picture whose file is in memory; `path` is for messages.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Self, LoadError> {
        let Decoded { size, format, data, .. } = Decoded::new(bytes, Place::file(path))?;
        let pixels = match data {
            Data::Linear(pixels, _) => pixels,
            Data::Coded(picture) => {
                // Codes of 8 and 16 bits become shares of 1.
                picture.into_rgb32f().pixels().map(|pixel| Vec3::from_array(pixel.0.map(linear_from_srgb))).collect()
            }
        };
        Ok(Self { size, pixels, format })
    }
}

/// Pixels of a picture that a scene uses, the first row on top.
#[derive(Debug)]
pub(super) enum Pixels {
    /// sRGB codes, with alpha where the file has it.
    Coded(Vec<[u8; 3]>, Option<Vec<u8>>),
    /// Linear light, finite and at least 0, with alpha where the file has it.
    Linear(Vec<Vec3>, Option<Vec<f32>>),
}

/// Reads size and pixels of the picture `path`, which was named at `place`.
pub(super) fn read(
    files: Files<'_>,
    path: &Path,
    place: Place<'_>,
    warnings: &mut Warnings,
) -> Result<(UVec2, Pixels), LoadError> {
    let bytes = files.read(path, place, limits::FILE_BYTES)?;
    let file = Place::file(path);
    let Decoded { size, data, has_other_primaries, .. } = Decoded::new(&bytes, file)?;
    if has_other_primaries {
        warnings.add(format!("{file}: its primaries are not those of Rec. 709, colours are taken as if they were"));
    }
    let pixels = match data {
        Data::Linear(mut pixels, alpha) => {
            warnings.add_times(format!("{file}: NaN, infinite or negative values replaced"), mend(&mut pixels));
            Pixels::Linear(pixels, alpha)
        }
        Data::Coded(picture) => {
            let alpha =
                picture.color().has_alpha().then(|| picture.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect());
            Pixels::Coded(picture.into_rgb8().pixels().map(|pixel| pixel.0).collect(), alpha)
        }
    };
    Ok((size, pixels))
}

/// What a file holds.
struct Decoded {
    size: UVec2,
    format: PictureFormat,
    /// Whether the file says that its colours are not those of Rec. 709.
    has_other_primaries: bool,
    data: Data,
}

enum Data {
    /// Linear light, whatever the file says, with alpha where it has it.
    Linear(Vec<Vec3>, Option<Vec<f32>>),
    /// sRGB codes.
    Coded(DynamicImage),
}

impl Decoded {
    fn new(bytes: &[u8], file: Place<'_>) -> Result<Self, LoadError> {
        let Some(format) = PictureFormat::of(bytes) else {
            let what = "neither PNG, JPEG, HDR nor EXR by its first bytes";
            return Err(file.unsupported(what, "convert the picture to one of these"));
        };
        let kind = match format {
            PictureFormat::Exr => {
                let ExrPicture { size, has_other_primaries, pixels, alpha } = picture_exr::decode(bytes, file)?;
                return Ok(Self { size, format, has_other_primaries, data: Data::Linear(pixels, alpha) });
            }
            PictureFormat::Hdr => return decode_hdr(bytes, file),
            PictureFormat::Png => ImageFormat::Png,
            PictureFormat::Jpeg => ImageFormat::Jpeg,
        };
        let damaged = |error| damaged(&error, file);
        let mut reader = ImageReader::with_format(Cursor::new(bytes), kind);
        let mut allocation = image::Limits::default();
        allocation.max_alloc = Some(limits::PIXELS * 16);
        reader.limits(allocation);
        let decoder = reader.into_decoder().map_err(damaged)?;
        let (width, height) = decoder.dimensions();
        let unpacked = u64::from(decoder.color_type().bytes_per_pixel());
        check_size(width.into(), height.into(), unpacked, bytes.len(), file)?;
        let picture = DynamicImage::from_decoder(decoder).map_err(damaged)?;
        let size = UVec2::new(width, height);
        Ok(Self { size, format, has_other_primaries: false, data: Data::Coded(picture) })
    }
}

/// The first bytes of a Radiance picture, and what some programs write in their place.
const HDR: &[u8] = b"#?RADIANCE";
const OTHER_HDR: &[u8] = b"#?RGBE";

/// Decodes a Radiance picture; what it says of exposure and colour correction is undone, which leaves radiance.
fn decode_hdr(bytes: &[u8], file: Place<'_>) -> Result<Decoded, LoadError> {
    let renamed = bytes.strip_prefix(OTHER_HDR).map(|rest| [HDR, rest].concat());
    let decoder = HdrDecoder::new(Cursor::new(renamed.as_deref().unwrap_or(bytes)));
    let decoder = decoder.map_err(|error| damaged(&error, file))?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into(), 12, bytes.len(), file)?;
    let HdrMetadata { exposure, color_correction, custom_attributes, .. } = decoder.metadata();
    let factor = exposure.unwrap_or(1.0) * color_correction.map_or(Vec3::ONE, Vec3::from);
    if !(factor.min_element() > 0.0 && factor.is_finite()) {
        let what = format!("EXPOSURE and COLORCORR make a factor of {factor}");
        return Err(file.invalid(what, "remove these lines, or give numbers above 0"));
    }
    let named = custom_attributes.iter().rfind(|(key, _)| key == "PRIMARIES");
    let numbers =
        named.map(|(_, value)| value.split_whitespace().filter_map(|word| word.parse().ok()).collect::<Vec<_>>());
    let has_other_primaries = numbers.is_some_and(|numbers| !is_rec_709(&numbers));
    let picture = DynamicImage::from_decoder(decoder).map_err(|error| damaged(&error, file))?;
    let pixels = picture.into_rgb32f().pixels().map(|pixel| Vec3::from_array(pixel.0) / factor).collect();
    let (size, data) = (UVec2::new(width, height), Data::Linear(pixels, None));
    Ok(Decoded { size, format: PictureFormat::Hdr, has_other_primaries, data })
}

/// Whether x and y of red, green, blue and white are those of Rec. 709, or as near as those that Radiance takes where
/// it is not told. Zeros tell nothing.
pub(super) fn is_rec_709(chromaticities: &[f32]) -> bool {
    const REC_709: [f32; 8] = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
    const NEAR: f32 = 0.025;
    let is_near = |known: [f32; 8]| chromaticities.iter().zip(known).all(|(x, known)| (x - known).abs() < NEAR);
    chromaticities.len() == REC_709.len() && (is_near(REC_709) || is_near([0.0; 8]))
}

fn damaged(error: &image::ImageError, file: Place<'_>) -> LoadError {
    match error {
        image::ImageError::Unsupported(_) => file.unsupported(error.to_string(), "save the picture in another way"),
        _ => file.invalid(format!("the picture is damaged: {error}"), "get the file again"),
    }
}

/// Refuses a size beyond the limits, before memory is taken for it. `unpacked` is the bytes that decoding takes for a
/// pixel.
pub(super) fn check_size(
    width: u64,
    height: u64,
    unpacked: u64,
    packed: usize,
    file: Place<'_>,
) -> Result<(), LoadError> {
    if width == 0 || height == 0 {
        return Err(file.invalid(format!("a picture of {width} x {height} pixels"), "give one with pixels"));
    }
    let pixels = width.saturating_mul(height);
    if pixels > limits::PIXELS || width.max(height) > u64::from(u32::MAX) {
        let what = format!("a picture of {width} x {height} pixels, more than the limit of {}", limits::PIXELS);
        return Err(file.too_large(what, "shrink it"));
    }
    let allowed = limits::UNPACKED_BYTES + limits::UNPACKED_RATIO * packed as u64;
    if pixels.saturating_mul(unpacked) > allowed {
        let what = format!("{width} x {height} pixels in a file of {packed} bytes cannot be true");
        return Err(file.too_large(what, "get the file again, or save it with less compression"));
    }
    Ok(())
}

/// Replaces NaN and negative values by 0 and infinite ones by the largest finite value; returns the number of pixels
/// mended.
fn mend(pixels: &mut [Vec3]) -> usize {
    let finite = pixels.iter().flat_map(|pixel| pixel.to_array()).filter(|value| value.is_finite());
    let largest = finite.fold(0.0, f32::max);
    let mut mended = 0;
    for pixel in pixels {
        if !pixel.is_finite() || pixel.min_element() < 0.0 {
            mended += 1;
            *pixel = pixel.map(|value| if value.is_nan() { 0.0 } else { value.clamp(0.0, largest) });
        }
    }
    mended
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_8_and_16_bits_mean_the_same_light() {
        let encoded = |picture: DynamicImage| {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
            Picture::decode(Path::new("a.png"), bytes.get_ref()).unwrap().pixels[0].x
        };
        let eight = encoded(image::GrayImage::from_pixel(1, 1, image::Luma([128])).into());
        let sixteen =
            encoded(DynamicImage::ImageLuma16(image::ImageBuffer::from_pixel(1, 1, image::Luma([128 * 257]))));
        assert!((eight - 0.215_861).abs() < 1e-5, "code 128 is {eight}");
        assert!((eight - sixteen).abs() < 1e-6, "{eight} and {sixteen}");
    }

    #[test]
    fn other_files_are_refused_by_name() {
        for bytes in [&b""[..], b"hello", b"GIF89a", b"\x89PNG\r\n\x1a\n", b"#?RADIANCE\n\n-Y 1 +X 0\n", b"v/1\x01"] {
            let line = Picture::decode(Path::new("a.bin"), bytes).unwrap_err().to_string();
            assert!(line.starts_with("a.bin: ") && line.contains("; "), "{line}");
        }
    }

    #[test]
    fn broken_values_are_replaced_and_counted() {
        let mut pixels = [
            Vec3::new(1.0, f32::NAN, 2.0),
            Vec3::new(f32::INFINITY, 0.5, f32::NEG_INFINITY),
            Vec3::new(3.0, 0.0, -0.1),
            Vec3::ONE,
        ];
        assert_eq!(mend(&mut pixels), 3, "three pixels are broken");
        assert_eq!(
            pixels,
            [Vec3::new(1.0, 0.0, 2.0), Vec3::new(3.0, 0.5, 0.0), Vec3::new(3.0, 0.0, 0.0), Vec3::ONE],
            "the rest stays"
        );
    }

    #[test]
    fn sizes_are_refused_before_memory_is_taken() {
        let file = Place::file(Path::new("a.png"));
        assert!(check_size(1, 1, 4, 60, file).is_ok(), "one pixel");
        assert!(check_size(16384, 16384, 3, 1 << 20, file).is_ok(), "2^28 pixels");
        assert!(
            matches!(check_size(16385, 16384, 3, 1 << 20, file), Err(LoadError::TooLarge(_))),
            "2^28 pixels and a column"
        );
        assert!(matches!(check_size(16384, 16384, 3, 355, file), Err(LoadError::TooLarge(_))), "a bomb");
        assert!(
            matches!(check_size(u64::MAX, u64::MAX, u64::MAX, 355, file), Err(LoadError::TooLarge(_))),
            "no overflow"
        );
        assert!(matches!(check_size(0, 7, 3, 355, file), Err(LoadError::Invalid(_))), "no pixels");
    }
}
