//! OpenEXR pictures: the first flat part with channels R, G and B, and A if there is one. Sizes are checked on the
//! header, as the library has no limits.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{Compression, ReadChannels, ReadLayers, Vec2 as Size, read};
use glam::{UVec2, Vec3};

use super::error::{LoadError, Place};
use super::picture::{check_size, is_rec_709};

/// What a file holds within its display window; it is black where no pixel is given.
pub(super) struct ExrPicture {
    pub(super) size: UVec2,
    /// Whether the file says that its colours are not those of Rec. 709.
    pub(super) has_other_primaries: bool,
    /// Rows from the top.
    pub(super) pixels: Vec<Vec3>,
    /// Of each pixel, where there is a channel A.
    pub(super) alpha: Option<Vec<f32>>,
}

/// Decodes a file that is in memory.
pub(super) fn decode(bytes: &[u8], file: Place<'_>) -> Result<ExrPicture, LoadError> {
    let damaged = |error: exr::error::Error| {
        file.invalid(format!("the EXR is damaged or not supported: {error}"), "save it as a flat EXR with ZIP")
    };
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        check_header(header, bytes.len(), file)?;
    }
    let Some(header) = meta.headers.iter().find(|header| !header.deep && has_rgb(header)) else {
        return Err(no_rgb(&meta, file));
    };
    let display = header.shared_attributes.display_window;
    let has_other_primaries = header.shared_attributes.chromaticities.is_some_and(|told| {
        let points = [told.red, told.green, told.blue, told.white];
        !is_rec_709(points.map(|Size(x, y)| [x, y]).as_flattened())
    });
    let Size(width, height) = display.size;
    let offset = header.own_attributes.layer_position - display.position;
    let layer_size = header.layer_size;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            move |size, (_, _, _, alpha)| {
                let alpha = alpha.is_some().then(|| vec![0.0; width * height]);
                (size, vec![Vec3::ZERO; width * height], alpha)
            },
            move |(_, pixels, alpha): &mut Planes, at, (r, g, b, a): (f32, f32, f32, f32)| {
                if let Some((x, y)) = moved(at.x(), offset.x(), width).zip(moved(at.y(), offset.y(), height)) {
                    let place = y * width + x;
                    pixels[place] = Vec3::new(r, g, b);
                    if let Some(alpha) = alpha {
                        alpha[place] = a;
                    }
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        // Decoding in this thread keeps a fault of the decoder in this call.
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let (decoded_size, pixels, alpha) = image.layer_data.channel_data.pixels;
    if decoded_size != layer_size {
        return Err(file.unsupported("parts of different sizes", "save the picture as one part"));
    }
    let side = |n: usize| u32::try_from(n).map_err(|_| file.too_large("a side beyond 32 bits", "shrink it"));
    let size = UVec2::new(side(width)?, side(height)?);
    Ok(ExrPicture { size, has_other_primaries, pixels, alpha })
}

/// Size of the data window; pixels and alpha of the display window.
type Planes = (Size<usize>, Vec<Vec3>, Option<Vec<f32>>);

/// Returns where a pixel of the data window is in the display window, along one side.
fn moved(at: usize, offset: i32, side: usize) -> Option<usize> {
    let at = i64::try_from(at).ok()? + i64::from(offset);
    usize::try_from(at).ok().filter(|&at| at < side)
}

/// Refuses what would take too much memory, and compression that is too young to be trusted with hostile files.
fn check_header(header: &Header, packed: usize, file: Place<'_>) -> Result<(), LoadError> {
    let Size(width, height) = header.layer_size;
    let sample_bytes: u64 =
        header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample() as u64).sum();
    check_size(width as u64, height as u64, sample_bytes.max(1), packed, file)?;
    // Sixteen bytes a pixel are ours.
    let Size(width, height) = header.shared_attributes.display_window.size;
    check_size(width as u64, height as u64, 16, packed, file)?;
    if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Err(file.unsupported("DWA compression", "save the EXR with ZIP"));
    }
    Ok(())
}

fn has_rgb(header: &Header) -> bool {
    ["R", "G", "B"].iter().all(|&name| header.channels.list.iter().any(|channel| channel.name.eq(name)))
}

fn no_rgb(meta: &MetaData, file: Place<'_>) -> LoadError {
    if meta.headers.iter().all(|header| header.deep) {
        return file.unsupported("the EXR holds deep data only", "flatten it");
    }
    let names = meta.headers.iter().flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    let names: Vec<String> = names.take(12).collect();
    let what =
        format!("no channels R, G and B, but {}", if names.is_empty() { "none".to_owned() } else { names.join(", ") });
    file.unsupported(what, "save the EXR in RGB")
}
