//! Pictures: PNG, JPEG and HDR by the `image` crate, EXR by [`super::picture_exr`], told apart by content.

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::error::{LoadError, Place};
use super::files::Files;
use super::limits;
use super::picture_exr;
use super::warnings::Warnings;

/// A picture's pixels, the first row on top.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: Pixels,
}

#[derive(Debug)]
pub(super) enum Pixels {
    /// sRGB codes, with alpha where the file has it.
    Coded(Vec<[u8; 3]>, Option<Vec<u8>>),
    /// Linear light, finite and at least 0.
    Linear(Vec<Vec3>),
}

/// Reads the picture `path`, which was named at `place`.
pub(super) fn read(
    files: Files<'_>,
    path: &Path,
    place: Place<'_>,
    warnings: &mut Warnings,
) -> Result<Picture, LoadError> {
    let bytes = files.read(path, place, limits::FILE_BYTES)?;
    let file = Place::file(path);
    let mut picture =
        if picture_exr::is_exr(&bytes) { picture_exr::decode(&bytes, file)? } else { decode(&bytes, file)? };
    if let Pixels::Linear(pixels) = &mut picture.pixels {
        warnings.add_times(format!("{file}: NaN, infinite or negative values replaced"), mend(pixels));
    }
    Ok(picture)
}

/// Refuses a size beyond the limits, before memory is taken for it. `unpacked` is the bytes that decoding takes for a pixel.
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

fn decode(bytes: &[u8], file: Place<'_>) -> Result<Picture, LoadError> {
    let damaged =
        |error: image::ImageError| file.invalid(format!("the picture is damaged: {error}"), "get the file again");
    let guessed = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = guessed.map_err(|error| file.unreadable(error.to_string(), "get the file again"))?;
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Hdr)) {
        return Err(file
            .unsupported("neither PNG, JPEG, HDR nor EXR by its first bytes", "convert the picture to one of these"));
    }
    let mut allocation = image::Limits::default();
    allocation.max_alloc = Some(limits::PIXELS * 16);
    reader.limits(allocation);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let unpacked = u64::from(decoder.color_type().bytes_per_pixel());
    check_size(width.into(), height.into(), unpacked, bytes.len(), file)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    let pixels = match picture {
        DynamicImage::ImageRgb32F(buffer) => {
            Pixels::Linear(buffer.pixels().map(|pixel| Vec3::from_array(pixel.0)).collect())
        }
        picture => {
            let alpha =
                picture.color().has_alpha().then(|| picture.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect());
            Pixels::Coded(picture.into_rgb8().pixels().map(|pixel| pixel.0).collect(), alpha)
        }
    };
    Ok(Picture { width, height, pixels })
}

/// Replaces NaN and negative values by 0 and infinite ones by the largest finite value; returns the number of pixels mended.
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
