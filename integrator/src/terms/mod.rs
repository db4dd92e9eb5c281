//! The terms of eq. 7, each in a file of its own.
//!
//! `emitted` needs none: primary rays meet it (see `surface_points`). The specular term of mirrors and glass is the
//! light of the surfaces that they show, so it is found there as well.

pub(crate) mod behind_glass;
pub(crate) mod direct;
pub(crate) mod direct_fit;
pub(crate) mod glossy;
pub(crate) mod guide;
pub(crate) mod indirect;
pub(crate) mod light_guide;
pub(crate) mod reuse;
mod tiles;
mod wide;
