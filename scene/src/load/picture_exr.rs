//! OpenEXR pictures: the first flat part with channels R, G and B. Sizes are checked on the header, as the library has no limits.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{Compression, ReadChannels, ReadLayers, Vec2 as Size, read};
use glam::{UVec2, Vec3};

use super::error::{LoadError, Place};
use super::picture::check_size;

/// Decodes a file that is in memory: size and pixels.
pub(super) fn decode(bytes: &[u8], file: Place<'_>) -> Result<(UVec2, Vec<Vec3>), LoadError> {
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
    let Size(width, height) = header.layer_size;
    let image = read()
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
        // Decoding in this thread keeps a fault of the decoder in this call.
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let (_, pixels) = image.layer_data.channel_data.pixels;
    let side = |n: usize| u32::try_from(n).map_err(|_| file.too_large("a side beyond 32 bits", "shrink it"));
    let size = UVec2::new(side(width)?, side(height)?);
    if pixels.len() as u64 != u64::from(size.x) * u64::from(size.y) {
        return Err(file.unsupported("parts of different sizes", "save the picture as one part"));
    }
    Ok((size, pixels))
}

/// Refuses what would take too much memory, and compression that is too young to be trusted with hostile files.
fn check_header(header: &Header, packed: usize, file: Place<'_>) -> Result<(), LoadError> {
    let Size(width, height) = header.layer_size;
    let sample_bytes: u64 =
        header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample() as u64).sum();
    check_size(width as u64, height as u64, sample_bytes.max(1), packed, file)?;
    // Twelve bytes a pixel are ours.
    check_size(width as u64, height as u64, 12, packed, file)?;
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
