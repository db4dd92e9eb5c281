//! Facts that hold for every method: each against a closed form, a reference, or another picture that must be the same.
//!
//! What a method promises is written once, in `tests::Measured`: the path tracer has no bias, the others a mean within
//! 1 % and blocks of pixels within 5 %. `cargo test -p tests -- --nocapture` shows what was measured.

mod bands;
mod bounces;
mod caustics;
mod furnace;
mod glass;
mod lamps;
mod leaks;
mod media;
mod meshes;
mod sky;
mod study;
mod terms;
mod threads;
mod units;
