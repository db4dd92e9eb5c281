#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]

mod atan;
mod disk;
pub mod double;
mod frame;
mod hemisphere;
mod sincos;
mod slice;

pub use atan::atan_unit;
pub use disk::{disk_to_square, square_to_disk, texel_index};
pub use frame::Frame;
pub use glam;
pub use hemisphere::{
    cosine_hemisphere_to_square, square_to_cosine_hemisphere, square_to_cosine_hemisphere_pdf,
    square_to_uniform_hemisphere, square_to_uniform_hemisphere_pdf, uniform_hemisphere_to_square,
};
pub use sincos::sin_cos_turn;
pub use slice::{
    cosine_hemisphere_to_square_slice, square_to_cosine_hemisphere_slice, square_to_uniform_hemisphere_slice,
    uniform_hemisphere_to_square_slice,
};
