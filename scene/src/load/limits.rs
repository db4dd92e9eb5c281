//! What a file may ask for at most. Each limit is enforced before memory is taken and refused by name.

/// Bytes of one file.
pub const FILE_BYTES: u64 = 2 << 30;
/// Bytes of one scene file, which is held as text and as a tree.
pub const SCENE_FILE_BYTES: u64 = 64 << 20;
/// Bytes of one line of an OBJ or MTL file, continued lines joined.
pub const LINE_BYTES: usize = 16 << 20;
/// Bytes of a name.
pub const NAME_BYTES: usize = 4096;
/// Pixels of a picture or a film.
pub const PIXELS: u64 = 1 << 28;
/// Width and height of a film.
pub const FILM_SIDE: u32 = 1 << 14;
/// Samples a pixel.
pub const SPP: u32 = 1 << 20;
/// Triangles of a scene.
pub const TRIANGLES: usize = 1 << 28;
/// Corners of one polygon.
pub const CORNERS: usize = 1 << 16;
/// Corners of one polygon that is not a fan as seen from its first corner; cutting its ears may take quadratic time.
pub const CONCAVE_CORNERS: usize = 1 << 12;
/// Sum of the squared corners of all such polygons of a scene.
pub const CONCAVE_SQUARES: usize = 1 << 28;
/// Copies of free forms in a scene.
pub const COPIES: u64 = 1 << 22;
/// Materials of a scene.
pub const MATERIALS: usize = 1 << 16;
/// Files that a scene includes.
pub const INCLUDES: usize = 1000;
/// Largest coordinate, in metres: beyond it squared areas overflow single precision.
pub const COORDINATE: f64 = 1e9;
/// Bytes that a picture may unpack to whatever its file's size: 64 MB and 4096 times the file.
pub const UNPACKED_BYTES: u64 = 64 << 20;
/// See [`UNPACKED_BYTES`]; deflate packs at most 1032 to 1, wavelets a few times more.
pub const UNPACKED_RATIO: u64 = 4096;
