//! Lights against their closed forms: samples of each kind, their densities, and photons.

mod choice;
mod forms;
mod many;
mod measure;
mod surroundings;
mod target;
mod triangles;
