//! Surroundings at infinity: a picture in longitude and latitude.
//!
//! ```text
//! u = atan2(x, -z) / 2 pi mod 1        the left edge is -z, a quarter to the right +x, the middle +z
//! v = acos(y) / pi                     the first row is up
//! ```
//! The lookup is bilinear with texel centres at column u W - 1/2 (wrapping round) and row v H - 1/2 (clamped).

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Vec2, Vec3, Vec3A};

/// Radiance from infinity, W m^-2 sr^-1.
#[derive(Debug, Clone)]
pub struct Environment {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) pixels: Vec<Vec3>,
}

impl Environment {
    /// Returns the surroundings that a picture holds, the first row up.
    ///
    /// # Panics
    /// If there are no pixels or their number is not `width * height`.
    #[must_use]
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<Vec3>) -> Self {
        assert!(!pixels.is_empty(), "an environment has pixels");
        assert!(pixels.len() == width as usize * height as usize, "{width} x {height} is not {}", pixels.len());
        Self { width, height, pixels }
    }

    /// Returns the same radiance from everywhere.
    #[must_use]
    pub fn constant(radiance: Vec3) -> Self {
        Self { width: 1, height: 1, pixels: vec![radiance] }
    }

    /// Returns an overcast sky for scenes that have no light: the CIE overcast distribution (1 + 2 sin elevation) / 3,
    /// of radiance 1 at the zenith and a little bluish, over a ground of radiance 0.2.
    #[must_use]
    pub fn sky() -> Self {
        const ROWS: u32 = 64;
        let pixels = (0..ROWS).map(|row| {
            let elevation = (PI * (row as f32 + 0.5) / ROWS as f32).cos();
            if elevation > 0.0 {
                Vec3::new(0.93, 0.98, 1.09) * ((1.0 + 2.0 * elevation) / 3.0)
            } else {
                Vec3::new(0.21, 0.2, 0.18)
            }
        });
        Self { width: 1, height: ROWS, pixels: pixels.collect() }
    }

    /// Returns the same surroundings, `factor` times as bright.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        for pixel in &mut self.pixels {
            *pixel *= factor;
        }
        self
    }

    /// Returns width and height in pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the memory held, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.pixels.capacity() * size_of::<Vec3>()
    }

    /// Returns the radiance that arrives from the unit vector `direction`.
    #[inline]
    #[must_use]
    pub fn radiance(&self, direction: Vec3A) -> Vec3 {
        // The same number from everywhere needs no angles.
        if self.pixels.len() == 1 { self.pixels[0] } else { self.radiance_at(direction_to_uv(direction)) }
    }

    /// Returns the radiance at a place of the picture that [`direction_to_uv`] gives.
    #[inline]
    pub(crate) fn radiance_at(&self, uv: Vec2) -> Vec3 {
        if self.pixels.len() == 1 {
            return self.pixels[0];
        }
        let (width, height) = (self.width as usize, self.height as usize);
        // The texels to the right and below; a cast rounds down, for these numbers are positive.
        let (right, fx) = split(uv.x * self.width as f32 + 0.5);
        let (bottom, fy) = split(uv.y * self.height as f32 + 0.5);
        let left = if right == 0 { width - 1 } else { right - 1 };
        let right = if right >= width { 0 } else { right };
        let (top, bottom) = (bottom.max(1) - 1, bottom.min(height - 1));
        let at = |x: usize, y: usize| self.pixels[y * width + x];
        at(left, top).lerp(at(right, top), fx).lerp(at(left, bottom).lerp(at(right, bottom), fx), fy)
    }
}

/// Returns the whole part of a small positive number and the rest.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a column or row number")]
fn split(x: f32) -> (usize, f32) {
    let whole = x as usize;
    (whole, x - whole as f32)
}

/// Returns where a unit direction lies in the picture, in [0, 1]^2.
#[inline]
pub(crate) fn direction_to_uv(direction: Vec3A) -> Vec2 {
    let u = atan2(direction.x, -direction.z) / TAU;
    // acos loses half the digits near the poles; atan2 does not.
    let v = atan2(Vec2::new(direction.x, direction.z).length(), direction.y) / PI;
    Vec2::new(if u < 0.0 { u + 1.0 } else { u }, v)
}

/// Returns the angle of (`x`, `y`) from the first axis, in [-pi, pi]; some angle where both are 0. Quicker than the
/// platform's, and the same bits on all of them.
#[inline]
fn atan2(y: f32, x: f32) -> f32 {
    let (across, along) = (y.abs(), x.abs());
    let octant = hemimap::atan_unit(across.min(along) / across.max(along).max(f32::MIN_POSITIVE));
    let quadrant = if across > along { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    half.copysign(y)
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "columns and rows")]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_platform() {
        for i in 0..10_000 {
            let exact = f64::from(i) * std::f64::consts::TAU / 10_000.0 - std::f64::consts::PI;
            let (y, x) = exact.sin_cos();
            let Vec2 { x, y } = glam::DVec2::new(3.0 * x, 3.0 * y).as_vec2();
            // Two steps of a number near pi, one of each.
            assert!((atan2(y, x) - y.atan2(x)).abs() < 5e-7, "({x}, {y}): {} instead of {}", atan2(y, x), y.atan2(x));
        }
        assert!(atan2(0.0, 0.0).is_finite(), "at a pole");
    }

    #[test]
    fn texels_are_joined_round_the_seam_and_kept_at_the_poles() {
        for (width, height) in [(1u8, 4u8), (4, 1), (3, 2), (5, 5)] {
            let (w, h) = (usize::from(width), usize::from(height));
            let pixels: Vec<Vec3> = (0..width * height).map(|i| Vec3::splat(f32::from(i).powi(2))).collect();
            let environment = Environment::from_pixels(width.into(), height.into(), pixels.clone());
            for step in 0..=400u16 {
                for v in [0.0, 0.1, 0.5, 0.77, 1.0] {
                    let u = f32::from(step) / 400.0;
                    // The texel whose middle lies at or before the place, and how far that is behind it.
                    let (x, y) =
                        (u * f32::from(width) - 0.5, (v * f32::from(height) - 0.5).clamp(0.0, f32::from(height - 1)));
                    let left = if x < 0.0 { w - 1 } else { x as usize };
                    let (right, top, bottom) = ((left + 1) % w, y as usize, (y as usize + 1).min(h - 1));
                    let row = |row: usize| pixels[row * w + left].lerp(pixels[row * w + right], x - x.floor());
                    let expected = row(top).lerp(row(bottom), y - y.floor());
                    let found = environment.radiance_at(Vec2::new(u, v));
                    assert!(
                        found.abs_diff_eq(expected, 1e-3),
                        "{width} x {height} at {u}, {v}: {found}, not {expected}"
                    );
                }
            }
        }
    }
}
