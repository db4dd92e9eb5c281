//! Pictures on surfaces.
//!
//! Coordinates repeat; v = 0 is the lowest row; texel centres are at (i + 1/2) / size. 8-bit colours are sRGB and
//! become linear before the bilinear filter, so that a filtered colour is the mean of light and not of codes.

use glam::{Vec2, Vec3};

use crate::srgb::linear_from_srgb;

/// A picture for colours, light or masks.
#[derive(Debug, Clone)]
pub struct Texture {
    width: u32,
    height: u32,
    texels: Texels,
    /// See [`Texture::range`].
    range: (f32, f32),
}

#[derive(Debug, Clone)]
enum Texels {
    /// 8-bit codes and what each means as linear light.
    Coded {
        codes: Vec<[u8; 3]>,
        linear: Box<[f32; 256]>,
    },
    Linear(Vec<Vec3>),
}

impl Texture {
    /// Returns a texture of 8-bit sRGB colours, the first row on top.
    ///
    /// # Panics
    /// If there are no texels or their number is not `width * height`.
    #[must_use]
    pub fn from_srgb8(width: u32, height: u32, codes: Vec<[u8; 3]>) -> Self {
        check_size(width, height, codes.len());
        let linear = Box::new(std::array::from_fn(|code| linear_from_srgb(code as f32 / 255.0)));
        Self { width, height, texels: Texels::Coded { codes, linear }, range: (0.0, 1.0) }
    }

    /// Returns a texture of linear values, the first row on top.
    ///
    /// # Panics
    /// If there are no texels or their number is not `width * height`.
    #[must_use]
    pub fn from_linear(width: u32, height: u32, texels: Vec<Vec3>) -> Self {
        check_size(width, height, texels.len());
        let channels = texels.iter().flat_map(|texel| texel.to_array());
        let range = channels.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| {
            if x.is_nan() || low.is_nan() { (f32::NAN, f32::NAN) } else { (low.min(x), high.max(x)) }
        });
        Self { width, height, texels: Texels::Linear(texels), range }
    }

    /// Returns width and height in texels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the linear colour at `uv`.
    #[inline]
    #[must_use]
    pub fn color(&self, uv: Vec2) -> Vec3 {
        match &self.texels {
            Texels::Coded { codes, linear } => {
                self.filter(uv, |i| Vec3::from_array(codes[i].map(|code| linear[code as usize])))
            }
            Texels::Linear(texels) => self.filter(uv, |i| texels[i]),
        }
    }

    /// Returns the mask at `uv`: the mean of the three channels as the file has them, 8-bit codes over 255.
    #[inline]
    #[must_use]
    pub fn mask(&self, uv: Vec2) -> f32 {
        let rgb = match &self.texels {
            Texels::Coded { codes, .. } => {
                self.filter(uv, |i| Vec3::from_array(codes[i].map(|code| f32::from(code) / 255.0)))
            }
            Texels::Linear(texels) => self.filter(uv, |i| texels[i]),
        };
        rgb.element_sum() / 3.0
    }

    /// Whether no texel shines.
    #[must_use]
    pub fn is_black(&self) -> bool {
        (0..self.width as usize * self.height as usize).all(|i| self.is_black_at(i))
    }

    fn is_black_at(&self, i: usize) -> bool {
        match &self.texels {
            Texels::Coded { codes, .. } => codes[i] == [0; 3],
            Texels::Linear(texels) => texels[i] == Vec3::ZERO,
        }
    }

    /// Whether it is black wherever the coordinates lie between `least` and `most`. Where that are many texels they are
    /// not looked at: then it may not be.
    pub(crate) fn is_black_between(&self, least: Vec2, most: Vec2) -> bool {
        const MOST_TEXELS: i64 = 4096;
        let size = Vec2::new(self.width as f32, self.height as f32);
        // A texel more to each side than the filter reaches, for rounding; rows run down.
        let low = (Vec2::new(least.x, 1.0 - most.y) * size - 2.0).floor();
        let high = (Vec2::new(most.x, 1.0 - least.y) * size + 2.0).floor();
        if !(low.is_finite() && high.is_finite() && low.abs().max(high.abs()).max_element() < 1e9) {
            return false;
        }
        let (low, high) = (low.as_i64vec2(), high.as_i64vec2());
        if (high - low + 1).element_product() > MOST_TEXELS {
            return false;
        }
        let texel = |x: i64, y: i64| wrap(y, self.height) as usize * self.width as usize + wrap(x, self.width) as usize;
        (low.y..=high.y).all(|y| (low.x..=high.x).all(|x| self.is_black_at(texel(x, y))))
    }

    /// Returns the memory held, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        match &self.texels {
            Texels::Coded { codes, .. } => codes.capacity() * 3 + 1024,
            Texels::Linear(texels) => texels.capacity() * size_of::<Vec3>(),
        }
    }

    /// Returns bounds of all channels of all texels, linear: of 8-bit codes those that they can have, else the least
    /// and the greatest value; NaN if any is.
    pub(crate) fn range(&self) -> (f32, f32) {
        self.range
    }

    #[inline]
    fn filter(&self, uv: Vec2, texel: impl Fn(usize) -> Vec3) -> Vec3 {
        let (x0, x1, fx) = neighbours(uv.x, self.width);
        let (y0, y1, fy) = neighbours(1.0 - uv.y, self.height);
        let at = |x: u32, y: u32| texel(y as usize * self.width as usize + x as usize);
        let top = at(x0, y0).lerp(at(x1, y0), fx);
        let bottom = at(x0, y1).lerp(at(x1, y1), fx);
        top.lerp(bottom, fy)
    }
}

/// Returns the two texels around coordinate `u`, which repeats, and the weight of the second.
#[inline]
fn neighbours(u: f32, size: u32) -> (u32, u32, f32) {
    // Infinite and NaN coordinates give NaN here, which the casts turn into 0.
    let x = (u - u.floor()) * size as f32 - 0.5;
    let floor = x.floor();
    let fraction = x - floor;
    #[expect(clippy::cast_possible_truncation, reason = "a number between -1 and the picture's size")]
    let first = floor as i64;
    (wrap(first, size), wrap(first + 1, size), if fraction.is_finite() { fraction } else { 0.0 })
}

/// Returns a number of a texel that repeats.
fn wrap(i: i64, size: u32) -> u32 {
    u32::try_from(i.rem_euclid(i64::from(size))).unwrap_or(0)
}

fn check_size(width: u32, height: u32, count: usize) {
    assert!(count > 0, "a texture has texels");
    assert!(count == width as usize * height as usize, "a texture of {width} x {height} has {count} texels");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two by two: black and white above, grey codes below.
    fn checker() -> Texture {
        Texture::from_srgb8(2, 2, vec![[0; 3], [255; 3], [188; 3], [255, 0, 0]])
    }

    #[test]
    fn lowest_row_is_at_v_zero() {
        let texture = checker();
        assert!((texture.color(Vec2::new(0.25, 0.75)) - Vec3::ZERO).length() < 1e-6, "upper left");
        assert!((texture.color(Vec2::new(0.75, 0.75)) - Vec3::ONE).length() < 1e-6, "upper right");
        assert!((texture.color(Vec2::new(0.75, 0.25)) - Vec3::X).length() < 1e-6, "lower right");
        // sRGB code 188 is 0.5028 linear (IEC 61966-2-1).
        assert!((texture.color(Vec2::new(0.25, 0.25)).x - 0.50289).abs() < 1e-4, "lower left is made linear");
        assert!((texture.mask(Vec2::new(0.25, 0.25)) - 188.0 / 255.0).abs() < 1e-6, "a mask is taken as it is");
    }

    #[test]
    fn black_is_found_where_all_of_it_is() {
        // One texel of 64 x 32 shines: the third from the left, in the fifth row from below.
        let mut texels = vec![Vec3::ZERO; 64 * 32];
        texels[(32 - 5) * 64 + 2] = Vec3::Y;
        let texture = Texture::from_linear(64, 32, texels);
        let place = Vec2::new(2.5 / 64.0, 4.5 / 32.0);
        let near = |u: f32, v: f32, reach: f32| {
            let p = Vec2::new(u, v);
            texture.is_black_between(p - reach, p + reach)
        };
        assert!(!texture.is_black() && Texture::from_srgb8(1, 1, vec![[0; 3]]).is_black(), "all of it");
        assert!(!near(place.x, place.y, 0.0) && !near(place.x, place.y, 0.3), "around the texel");
        assert!(!near(place.x - 3.0, place.y + 7.0, 0.01), "and its repetitions");
        assert!(!near(place.x + 1.0 / 64.0, place.y, 0.0), "and where the filter reaches it");
        assert!(near(0.5, 0.5, 0.1) && near(place.x, 1.0 - place.y, 0.01), "elsewhere it is black");
        assert!(!near(0.5, 0.5, 5.0) && !near(f32::NAN, 0.5, 0.1) && !near(1e30, 0.5, 0.1), "nobody looks there");
    }

    #[test]
    fn coordinates_repeat_and_filter_is_linear() {
        let texture = checker();
        for uv in [Vec2::new(0.3, 0.6), Vec2::new(0.01, 0.99)] {
            for shift in [Vec2::new(1.0, 0.0), Vec2::new(-3.0, 2.0)] {
                assert!((texture.color(uv) - texture.color(uv + shift)).length() < 1e-5, "{uv} moved by {shift}");
            }
        }
        // Half way between black and white, light is halved: not the code.
        assert!((texture.color(Vec2::new(0.5, 0.75)).x - 0.5).abs() < 1e-6, "filtered after it was made linear");
    }

    #[test]
    fn odd_coordinates_give_finite_colours() {
        for u in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e-30, 1.0, 0.0] {
            assert!(checker().color(Vec2::new(u, u)).is_finite(), "at {u}");
        }
    }
}
