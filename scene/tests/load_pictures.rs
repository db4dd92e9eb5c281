//! Pictures, right and hostile: EXR and HDR as surroundings, PNG and JPEG as textures.

mod common;

use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, SpecificChannels, Vec2 as Size, WritableImage,
};
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, Rgba};
use scene::glam::{Vec2, Vec3, Vec3A};
use scene::{LoadOptions, Loaded, Picture, SpecularKind, Texture};

const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
const BARE: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn with_environment(name: &str, bytes: &[u8]) -> Result<Loaded, String> {
    let options = LoadOptions { environment: Some(PathBuf::from(name)), ..LoadOptions::default() };
    common::load_files_with(&[("a.obj", BARE), (name, bytes)], &options)
}

fn assert_refused(name: &str, bytes: &[u8], part: &str) {
    let text = with_environment(name, bytes).map(|_| ()).expect_err(part);
    assert!(text.starts_with(&format!("{name}: ")) && text.contains(part), "wanted {part:?}; found {text}");
}

fn texture(key: &str, name: &str, bytes: &[u8]) -> Result<Texture, String> {
    let mtl = format!("newmtl m\n{key} {name}\n");
    let loaded = common::load_files(&[("a.obj", OBJ), ("a.mtl", mtl.as_bytes()), (name, bytes)])?;
    Ok(loaded.description.textures[0].clone())
}

/// An EXR of 4 x 3 pixels with the same `value` of the pixel's number in all channels.
fn exr_file(channels: &[&str], compression: Compression, value: impl Fn(usize) -> f32) -> Vec<u8> {
    let samples: Vec<f32> = (0..12).map(value).collect();
    let list = channels.iter().map(|&name| AnyChannel::new(name, FlatSamples::F32(samples.clone()))).collect();
    let encoding = Encoding { compression, ..Encoding::SMALL_LOSSLESS };
    let image = Image::from_layer(Layer::new((4, 3), LayerAttributes::default(), encoding, AnyChannels::sort(list)));
    let mut file = Cursor::new(Vec::new());
    image.write().to_buffered(&mut file).expect("an EXR is written");
    file.into_inner()
}

/// The file with the bytes after `header` replaced.
fn patched(file: &[u8], header: &[u8], bytes: &[u8]) -> Vec<u8> {
    let at =
        file.windows(header.len()).position(|window| window == header).expect("the header is there") + header.len();
    let mut file = file.to_vec();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

const WINDOW: &[u8] = b"dataWindow\0box2i\0\x10\0\0\0";
const COMPRESSION: &[u8] = b"compression\0compression\0\x01\0\0\0";

fn window(width: i32, height: i32) -> Vec<u8> {
    [0, 0, width - 1, height - 1].iter().flat_map(|n: &i32| n.to_le_bytes()).collect()
}

#[test]
fn exr_pictures_load() {
    for compression in
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ]
    {
        let loaded =
            with_environment("e.exr", &exr_file(&["A", "B", "G", "R", "Z"], compression, |i| i as f32)).unwrap();
        let environment = loaded.description.environment.expect("surroundings");
        assert_eq!(environment.size(), (4, 3), "{compression}");
        // Pixel 5 is in the middle row, second column: a quarter and a half of the way to the right.
        let angle = 1.5 / 4.0 * std::f32::consts::TAU;
        let seen = environment.radiance(Vec3A::new(angle.sin(), 0.0, -angle.cos()));
        assert!((seen - Vec3::splat(5.0)).length() < 1e-4, "{compression}: {seen}");
    }
}

#[test]
fn emission_alone_may_be_above_1() {
    let bright = exr_file(&["R", "G", "B"], Compression::ZIP16, |_| 5.0);
    let dark = exr_file(&["R", "G", "B"], Compression::ZIP16, |_| 0.0);
    for (picture, shines) in [(&bright, true), (&dark, false)] {
        let files = [("a.obj", OBJ), ("a.mtl", &b"newmtl m\nmap_Ke a.exr"[..]), ("a.exr", picture)];
        let description = common::load_files(&files).unwrap().description;
        let material = &description.materials[0];
        assert_eq!((material.diffuse, material.emission_texture), (Vec3::ZERO, shines.then_some(0)), "over black");
        assert_eq!(description.environment.is_none(), shines, "what does not shine gets a sky");
    }
    for (key, value) in [("map_Ke", 5.0), ("map_Kd", 1.0)] {
        let texture = texture(key, "a.exr", &bright).unwrap();
        assert_eq!(texture.color(Vec2::splat(0.5)), Vec3::splat(value), "{key}");
    }
    let toml = br#"
        [[material]]
        name = "screen"
        emission_texture = "a.exr"
        [[material]]
        name = "dim"
        emission = 0.25
        emission_texture = "a.exr"
        [[mesh]]
        material = "screen"
        positions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        faces = [[0, 1, 2]]
    "#;
    let loaded = common::load_files(&[("a.toml", toml), ("a.exr", &bright)]).unwrap();
    let [screen, dim] = [0, 1].map(|i| &loaded.description.materials[i]);
    assert_eq!((screen.emission, screen.diffuse), (Vec3::ONE, Vec3::ZERO), "all of the picture, over black");
    assert_eq!((dim.emission, dim.emission_texture), (Vec3::splat(0.25), screen.emission_texture), "a share of it");
    common::assert_builds(&loaded);
}

#[test]
fn reflectances_take_pictures() {
    let picture = exr_file(&["R", "G", "B"], Compression::ZIP16, |_| 0.5);
    let material = |lines: &str| {
        let mtl = format!("newmtl m\n{lines}\n");
        let files = [("a.obj", OBJ), ("a.mtl", mtl.as_bytes()), ("a.exr", &picture[..])];
        common::load_files(&files).unwrap().description.materials[0].clone()
    };
    let gloss = |alpha, reflectance| SpecularKind::Ggx { alpha, reflectance: Vec3::splat(reflectance), schlick: false };
    for (lines, specular, textures) in [
        ("Pm 1\nPr 0.5\nmap_Kd a.exr", gloss(0.25, 1.0), [None, Some(0)]),
        ("Kd 0.8\nPm 0.5\nPr 0.5\nmap_Kd a.exr", gloss(0.25, 0.4), [Some(0), Some(0)]),
        ("Kd 0.5\nmap_Ks a.exr\nPr 0.5", gloss(0.25, 1.0), [None, Some(0)]),
        ("Kd 0.5\nKs 0.3\nmap_Ks a.exr\nPr 0.5", gloss(0.25, 0.3), [None, Some(0)]),
        ("Kd 0.5\nKs 0.3\nmap_Kd a.exr\nPr 0.5", gloss(0.25, 0.3), [Some(0), None]),
        (
            "Kd 0\nKs 0.9\nillum 3\nmap_Ks a.exr",
            SpecularKind::Mirror { reflectance: Vec3::splat(0.9) },
            [None, Some(0)],
        ),
        ("Kd 0.5\nmap_Kd a.exr", SpecularKind::None, [Some(0), None]),
    ] {
        let found = material(lines);
        assert_eq!((found.specular, [found.diffuse_texture, found.specular_texture]), (specular, textures), "{lines}");
    }
    let toml = |specular: &str| {
        let toml = format!(
            "[[material]]\nname = \"a\"\n{specular}\nspecular_texture = \"a.exr\"\n\
            [[form]]\nquadric.sphere = {{ center = [0, 0, 0], radius = 1 }}"
        );
        common::load_files(&[("a.toml", toml.as_bytes()), ("a.exr", &picture)])
    };
    assert_eq!(toml("mirror.reflectance = 0.5").unwrap().description.materials[0].specular_texture, Some(0));
    let refused = toml("glass.ior = 1.5").unwrap_err();
    assert!(refused.starts_with("a.toml:4: a specular_texture without gloss or mirror; "), "{refused}");
}

#[test]
fn alpha_of_an_exr_is_a_mask() {
    let mask = |channels: &[&str], value: f32| {
        let texture = texture("map_d", "a.exr", &exr_file(channels, Compression::ZIP16, |_| value)).unwrap();
        texture.mask(Vec2::splat(0.5))
    };
    // RGB have the same values: made by hand where they differ.
    assert_eq!(mask(&["A", "B", "G", "R"], 0.25), 0.25);
    let samples = |value: f32| FlatSamples::F32(vec![value; 12]);
    let channels = [("A", 0.75), ("B", 0.1), ("G", 0.2), ("R", 0.3)];
    let list = channels.iter().map(|&(name, value)| AnyChannel::new(name, samples(value))).collect();
    let layer = Layer::new((4, 3), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file).expect("an EXR is written");
    let bytes = file.into_inner();
    assert_eq!(texture("map_d", "a.exr", &bytes).unwrap().mask(Vec2::splat(0.5)), 0.75, "by its alpha");
    let color = texture("map_Kd", "a.exr", &bytes).unwrap().color(Vec2::splat(0.5));
    assert_eq!(color, Vec3::new(0.3, 0.2, 0.1), "colours are as they are");
}

#[test]
fn an_exr_is_what_its_display_window_shows() {
    // Pixels of 4 x 3 from (-1, 1) on, shown from (0, 0) to (4, 4): the first column is cut, a row above and a column
    // on the right are black.
    let list = ["R", "G", "B"].map(|name| AnyChannel::new(name, FlatSamples::F32((1..=12u8).map(f32::from).collect())));
    let attributes = LayerAttributes { layer_position: Size(-1, 1), ..LayerAttributes::default() };
    let layer = Layer::new((4, 3), attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(list.into_iter().collect()));
    let display = IntegerBounds::new((0, 0), (4, 4));
    let mut file = Cursor::new(Vec::new());
    let image = Image::new(ImageAttributes::new(display), layer);
    image.write().to_buffered(&mut file).expect("an EXR is written");
    let picture = Picture::decode(Path::new("a.exr"), file.get_ref()).unwrap();
    let values: Vec<f32> = picture.pixels.iter().map(|pixel| pixel.x).collect();
    assert_eq!(picture.size.to_array(), [4, 4]);
    let rows = [[0.0; 4], [2.0, 3.0, 4.0, 0.0], [6.0, 7.0, 8.0, 0.0], [10.0, 11.0, 12.0, 0.0]];
    assert_eq!(values, rows.concat());
    let bytes = patched(file.get_ref(), b"displayWindow\0box2i\0\x10\0\0\0", &window(1_000_000, 1_000_000));
    assert_refused("e.exr", &bytes, "1000000 x 1000000 pixels, more than the limit");
}

#[test]
fn broken_values_in_an_exr_are_replaced_and_counted() {
    let value = |i| [f32::NAN, f32::INFINITY, -1.0, 2.0].get(i).copied().unwrap_or(1.0);
    let loaded = with_environment("e.exr", &exr_file(&["R", "G", "B"], Compression::ZIP16, value)).unwrap();
    assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    assert!(loaded.warnings[0].ends_with("replaced (3 times)"), "{:?}", loaded.warnings);
}

#[test]
fn hostile_exr_files_are_refused() {
    let good = exr_file(&["R", "G", "B"], Compression::ZIP16, |i| i as f32);
    let billion = patched(&good, WINDOW, &window(1_000_000_000, 1_000_000_000));
    assert_refused("e.exr", &billion, "1000000000 x 1000000000 pixels, more than the limit of 268435456");
    assert_refused("e.exr", &patched(&good, WINDOW, &window(16_000, 16_000)), "cannot be true");
    assert_refused("e.exr", &patched(&good, WINDOW, &window(0, 3)), "");
    assert_refused("e.exr", &patched(&good, COMPRESSION, &[77]), "compression");
    assert_refused("e.exr", &patched(&good, COMPRESSION, &[8]), "DWA");
    assert_refused("e.exr", &good[..good.len() - 10], "damaged");
    assert_refused("e.exr", &good[..4], "damaged");
    assert_refused("e.exr", &exr_file(&["Y", "Z"], Compression::ZIP16, |_| 1.0), "no channels R, G and B, but Y, Z");
}

#[test]
fn hdr_pictures_load() {
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    file.extend([128, 64, 0, 129, 255, 255, 255, 245]);
    let environment = with_environment("e.hdr", &file).unwrap().description.environment.expect("surroundings");
    assert_eq!(environment.size(), (2, 1), "two pixels, one with a large exponent");
    let seen = environment.radiance(Vec3A::X).max(environment.radiance(Vec3A::NEG_X));
    assert!(seen.is_finite() && seen.x > 1e34, "an exponent of 245: {seen}");
    let renamed = [b"#?RGBE", &file[10..]].concat();
    let pixels = |bytes: &[u8]| Picture::decode(Path::new("a.hdr"), bytes).unwrap().pixels;
    assert_eq!(pixels(&renamed), pixels(&file), "by the name that rgbe.c writes");
    // Twice exposed, 4 and 0.5, and corrected: the light is a half of what stands there, and of blue a fifth.
    let header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=4\nEXPOSURE= 0.5\nCOLORCORR=1 1 2.5\n\n-Y 1 +X 1\n";
    let exposed = [&header[..], &[128, 64, 32, 129]].concat();
    let pixels = Picture::decode(Path::new("a.hdr"), &exposed).unwrap().pixels;
    assert!((pixels[0] - Vec3::new(0.5, 0.25, 0.05)).length() < 1e-6, "{}", pixels[0]);
}

#[test]
fn other_primaries_are_told() {
    let warned = |name: &str, bytes: &[u8]| {
        let warnings = with_environment(name, bytes).unwrap().warnings;
        warnings.iter().filter(|line| line.contains(&format!("{name}: its primaries"))).count()
    };
    let hdr = |line: &str| format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{line}\n-Y 1 +X 1\n0000").into_bytes();
    let exr = |red: (f32, f32)| {
        let pixels = SpecificChannels::rgb(|_| (1.0, 1.0, 1.0));
        let mut image = Image::from_layer(Layer::new((4, 3), LayerAttributes::default(), Encoding::default(), pixels));
        let [green, blue, white] = [(0.3, 0.6), (0.15, 0.06), (0.3127, 0.329)].map(Size::from);
        image.attributes.chromaticities = Some(Chromaticities { red: red.into(), green, blue, white });
        let mut file = Cursor::new(Vec::new());
        image.write().to_buffered(&mut file).expect("an EXR is written");
        file.into_inner()
    };
    let usual = [
        ("e.hdr", hdr("")),
        ("e.hdr", hdr("PRIMARIES= 0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333\n")),
        ("e.hdr", hdr("PRIMARIES=0 0 0 0 0 0 0 0\n")),
        ("e.exr", exr_file(&["R", "G", "B"], Compression::ZIP16, |_| 1.0)),
        ("e.exr", exr((0.64, 0.33))),
    ];
    assert_eq!(usual.map(|(name, bytes)| warned(name, &bytes)), [0; 5], "what is known");
    let other = [
        ("e.hdr", hdr("PRIMARIES=0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.329\n")),
        ("e.hdr", hdr("PRIMARIES=wide\n")),
        ("e.exr", exr((0.713, 0.293))),
    ];
    assert_eq!(other.map(|(name, bytes)| warned(name, &bytes)), [1; 3], "what is not");
}

#[test]
fn hostile_hdr_files_are_refused() {
    let header = |size: &str| format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
    assert_refused("e.hdr", b"RADIANCE\n\n-Y 1 +X 1\n0000", "neither PNG, JPEG, HDR nor EXR");
    assert_refused("e.hdr", &header("-Y 1 +X 0"), "");
    assert_refused("e.hdr", &header("-Y 100000 +X 100000"), "more than the limit");
    assert_refused("e.hdr", &header("-Y 10000 +X 10000"), "cannot be true");
    assert_refused("e.hdr", &header("+Y 1 -X 1"), "save the picture in another way");
    assert_refused("e.hdr", &header("-Y 2 +X 8"), "damaged");
    let mut overrun = header("-Y 1 +X 8");
    overrun.extend([2, 2, 0, 8, 255, 1, 1, 1, 1, 1, 1, 1]);
    assert_refused("e.hdr", &overrun, "damaged");
    assert_refused("e.hdr", b"", "neither PNG");
    let dark = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=0\n\n-Y 1 +X 1\n0000";
    assert_refused("e.hdr", dark, "EXPOSURE and COLORCORR");
}

fn png(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    picture.into().write_to(&mut file, format).expect("a picture is written");
    file.into_inner()
}

#[test]
fn all_kinds_of_png_and_jpeg_load() {
    let color = |texture: &Texture| texture.color(Vec2::splat(0.5));
    let rgb8 = png(ImageBuffer::from_pixel(1, 1, Rgb([255_u8, 0, 188])), ImageFormat::Png);
    let linear = Vec3::new(1.0, 0.0, 0.502_886);
    assert!((color(&texture("map_Kd", "t.png", &rgb8).unwrap()) - linear).length() < 1e-4, "8 bit, one pixel");
    let rgb16 = png(ImageBuffer::from_pixel(2, 1, Rgb([65535_u16, 0, 188 * 257])), ImageFormat::Png);
    assert!((color(&texture("map_Kd", "t.png", &rgb16).unwrap()) - linear).length() < 1e-4, "16 bit");
    let rgba = png(ImageBuffer::from_pixel(1, 1, Rgba([255_u8, 0, 188, 51])), ImageFormat::Png);
    assert!((color(&texture("map_Kd", "t.png", &rgba).unwrap()) - linear).length() < 1e-4, "alpha");
    let mask = |texture: &Texture| texture.mask(Vec2::splat(0.5));
    assert!((mask(&texture("map_d", "t.png", &rgba).unwrap()) - 0.2).abs() < 1e-6, "a mask by its alpha");
    let grey = png(ImageBuffer::from_pixel(1, 1, Luma([51_u8])), ImageFormat::Png);
    assert!(
        (mask(&texture("map_d -imfchan l", "t.png", &grey).unwrap()) - 0.2).abs() < 1e-6,
        "a mask by its grey, not made linear"
    );
    let jpeg = png(ImageBuffer::from_pixel(8, 8, Rgb([255_u8, 255, 255])), ImageFormat::Jpeg);
    assert!((color(&texture("map_Kd", "t.png", &jpeg).unwrap()) - Vec3::ONE).length() < 0.02, "a JPEG by another name");
    let palette: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x03\0\0\0(\xcb4\xbb\0\0\0\x03PLTE\xff\0\0\x19\xe2\t7\0\0\0\nIDATx\x9cc`\0\0\0\x02\0\x01H\xaf\xa4q\0\0\0\0IEND\xaeB`\x82";
    assert_eq!(color(&texture("map_Kd", "t.png", palette).unwrap()), Vec3::X, "a palette of one red");
}

#[test]
fn hostile_png_files_are_refused() {
    let good = png(ImageBuffer::from_pixel(300, 300, Rgb([1_u8, 2, 3])), ImageFormat::Png);
    // Width and height stand after the chunk's name; the checksum after them is mended.
    let mut huge = patched(&good, b"IHDR", &[0, 0, 255, 255, 0, 0, 255, 255]);
    let checksum = crc32(&huge[12..29]);
    huge[29..33].copy_from_slice(&checksum.to_be_bytes());
    let refused = |bytes: &[u8], part: &str| {
        let text = texture("map_Kd", "t.png", bytes).map(|_| ()).expect_err(part);
        assert!(text.starts_with("t.png: ") && text.contains(part), "wanted {part:?}; found {text}");
    };
    refused(&huge, "65535 x 65535 pixels, more than the limit");
    refused(&good[..good.len() / 2], "damaged");
    refused(b"GIF89a", "neither PNG");
    assert_refused("e.png", &good, "an 8-bit picture as surroundings");
}

/// The checksum of PNG chunks, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| if sum & 1 == 1 { (sum >> 1) ^ 0xedb8_8320 } else { sum >> 1 })
    })
}

#[test]
fn scale_of_the_environment_is_checked() {
    let options = |scale| LoadOptions { environment: None, environment_scale: scale };
    let sky = |scale| common::load_files_with(&[("a.obj", BARE)], &options(scale));
    let up = |loaded: Loaded| loaded.description.environment.expect("a sky").radiance(Vec3A::Y).y;
    assert!((up(sky(3.0).unwrap()) - 3.0 * up(sky(1.0).unwrap())).abs() < 1e-5, "the sky is scaled too");
    for scale in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(sky(scale).unwrap_err().contains("scale"), "{scale}");
    }
    let missing = with_environment("e.exr", b"").unwrap_err();
    assert!(missing.starts_with("e.exr: neither"), "{missing}");
}
