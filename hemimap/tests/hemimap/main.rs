//! The facts that the public API promises, one module a topic.
#![expect(clippy::disallowed_methods, reason = "the platform's functions are the oracles")]
#![expect(clippy::cast_possible_truncation, reason = "inputs made in f64 are rounded to f32 on purpose")]

mod frames;
mod maps;
mod random;
mod samples;
mod slices;
