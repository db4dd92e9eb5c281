//! The binary as its users see it: exit codes, streams and files.

mod arguments;
mod chart;
mod common;
mod compare;
mod explain;
#[cfg(target_os = "linux")]
mod hostile;
mod mesh;
mod readme;
mod render;
