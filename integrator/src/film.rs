//! The film: the five terms of every pixel and what denoisers and compositors want beside them.
//!
//! Threads fill it by [`Band`]s of whole rows, each borrowed by one of them, so that no two ever write to the same
//! place and the result does not depend on their number.

use glam::{DVec3, UVec2, Vec3, Vec3A};
use scene::{Bsdf, Specular};

use crate::rungs::Rungs;

/// Radiance split by the way that the light came, W m^-2 sr^-1.
///
/// From the light L to the eye E, with D for a diffuse or glossy vertex, S for a mirror or glass, x1 the surface that
/// is seen and its f = f_d + f_s:
///
/// ```text
/// emitted   L E               light seen straight
/// direct    L x1 E            f   L_d    light that comes straight to x1, lamps seen in a mirror included
/// specular  L (S|D)+ x1 E     f_s (L_c + L_i)
/// caustic   L S+ x1 E         f_d L_c    light that came by mirrors and glass alone
/// indirect  L (S|D)+ x1 E     f_d L_i    all that is neither straight nor L_c
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Terms {
    /// Emitted by what is seen.
    pub emitted: Vec3,
    /// Straight from a light, by one reflection.
    pub direct: Vec3,
    /// Reflected by the specular part of what is seen, unless it is `direct`.
    pub specular: Vec3,
    /// Focused by mirrors or glass, then reflected by the diffuse part of what is seen.
    pub caustic: Vec3,
    /// All else that the diffuse part of what is seen reflects.
    pub indirect: Vec3,
}

impl Terms {
    /// Returns the sum, in the order that [`Film::picture`] keeps.
    #[inline]
    #[must_use]
    pub fn sum(&self) -> Vec3 {
        (((self.emitted + self.direct) + self.specular) + self.caustic) + self.indirect
    }

    /// Whether all values are finite.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.emitted, self.direct, self.specular, self.caustic, self.indirect].iter().all(|term| term.is_finite())
    }
}

/// What is known of the first surface that a primary ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstHit {
    /// Share of light that the surface reflects, in [0, 1]: diffuse albedo and the reflectance of gloss, 1 for mirrors
    /// and glass.
    pub albedo: Vec3,
    /// Shading normal, world space.
    pub normal: Vec3A,
    /// Distance from the eye, metres.
    pub depth: f32,
}

/// Returns the colour that a denoiser is given for a surface: diffuse albedo and the reflectance of gloss, 1 for
/// mirrors and glass.
#[must_use]
pub(crate) fn guide_albedo(bsdf: &Bsdf) -> Vec3 {
    match bsdf.specular {
        Specular::Mirror { .. } | Specular::Dielectric { .. } => Vec3::ONE,
        Specular::Ggx { reflectance, .. } => (bsdf.diffuse + reflectance).clamp(Vec3::ZERO, Vec3::ONE),
        Specular::None => bsdf.diffuse.clamp(Vec3::ZERO, Vec3::ONE),
    }
}

/// One finished pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pixel {
    pub(crate) terms: Terms,
    /// As in [`Film`], the others too.
    pub(crate) albedo: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) depth: f32,
    pub(crate) alpha: f32,
}

/// The samples of one pixel, summed in f64.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PixelSum {
    terms: [DVec3; 5],
    albedo: DVec3,
    normal: DVec3,
    depth: f64,
    hits: f64,
}

impl PixelSum {
    /// Adds a sample's light.
    pub(crate) fn add_terms(&mut self, terms: &Terms) {
        let values = [terms.emitted, terms.direct, terms.specular, terms.caustic, terms.indirect];
        for (sum, value) in self.terms.iter_mut().zip(values) {
            *sum += value.as_dvec3();
        }
    }

    /// Adds the surface that a sample met.
    pub(crate) fn add_hit(&mut self, hit: &FirstHit) {
        self.albedo += hit.albedo.as_dvec3();
        self.normal += hit.normal.as_dvec3();
        self.depth += f64::from(hit.depth);
        self.hits += 1.0;
    }

    /// Returns the mean over so many samples, those that met nothing included.
    #[must_use]
    pub(crate) fn mean(&self, samples: u32) -> Pixel {
        let scale = 1.0 / f64::from(samples);
        let [emitted, direct, specular, caustic, indirect] = self.terms.map(|sum| (sum * scale).as_vec3());
        #[expect(clippy::cast_possible_truncation, reason = "the film is f32")]
        let single = |x: f64| x as f32;
        Pixel {
            terms: Terms { emitted, direct, specular, caustic, indirect },
            albedo: (self.albedo * scale).as_vec3(),
            normal: (self.normal * scale).as_vec3(),
            depth: if self.hits > 0.0 { single(self.depth / self.hits) } else { f32::INFINITY },
            alpha: single(self.hits * scale),
        }
    }
}

/// A picture in its terms: structure of arrays, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// Width and height, pixels.
    pub size: UVec2,
    /// See [`Terms::emitted`].
    pub emitted: Vec<Vec3>,
    /// See [`Terms::direct`].
    pub direct: Vec<Vec3>,
    /// See [`Terms::specular`].
    pub specular: Vec<Vec3>,
    /// See [`Terms::caustic`].
    pub caustic: Vec<Vec3>,
    /// See [`Terms::indirect`].
    pub indirect: Vec<Vec3>,
    /// Mean of [`FirstHit::albedo`] over the pixel, 0 where there is no surface.
    pub albedo: Vec<Vec3>,
    /// Mean normal over the pixel, world space, not made unit; 0 where there is no surface.
    pub normal: Vec<Vec3>,
    /// Mean distance from the eye over the part of the pixel that shows a surface, metres; infinite where there is
    /// none.
    pub depth: Vec<f32>,
    /// Share of the pixel that shows a surface, in [0, 1].
    pub alpha: Vec<f32>,
    /// How each pixel got its indirect light, where [`Settings::rungs`](crate::Settings::rungs) asks for it; never by
    /// [`Method::Path`](crate::Method::Path).
    pub rungs: Option<Vec<Rungs>>,
}

/// Some whole rows of a [`Film`], to be filled by one thread.
#[derive(Debug)]
pub(crate) struct Band<'a> {
    /// Its first row in the film.
    pub(crate) first_row: u32,
    width: u32,
    emitted: &'a mut [Vec3],
    direct: &'a mut [Vec3],
    specular: &'a mut [Vec3],
    caustic: &'a mut [Vec3],
    indirect: &'a mut [Vec3],
    albedo: &'a mut [Vec3],
    normal: &'a mut [Vec3],
    depth: &'a mut [f32],
    alpha: &'a mut [f32],
    /// Empty where nobody asks for them.
    rungs: &'a mut [Rungs],
}

impl Film {
    /// Returns a black film that shows nothing. Takes 92 bytes a pixel.
    #[must_use]
    pub fn new(size: UVec2) -> Self {
        let count = size.x as usize * size.y as usize;
        let black = || vec![Vec3::ZERO; count];
        Self {
            size,
            emitted: black(),
            direct: black(),
            specular: black(),
            caustic: black(),
            indirect: black(),
            albedo: black(),
            normal: black(),
            depth: vec![f32::INFINITY; count],
            alpha: vec![0.0; count],
            rungs: None,
        }
    }

    /// Returns the number of pixels.
    #[must_use]
    pub fn pixel_count(&self) -> usize {
        self.depth.len()
    }

    /// Returns the memory that the pixels take, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> u64 {
        let pixel = 7 * size_of::<Vec3>() + 2 * size_of::<f32>();
        let rungs = self.rungs.as_ref().map_or(0, |rungs| size_of_val(&rungs[..]));
        (self.pixel_count() * pixel + rungs) as u64
    }

    /// Returns the terms of one pixel.
    ///
    /// # Panics
    ///
    /// When `pixel` is not below [`Film::pixel_count`].
    #[must_use]
    pub fn terms(&self, pixel: usize) -> Terms {
        Terms {
            emitted: self.emitted[pixel],
            direct: self.direct[pixel],
            specular: self.specular[pixel],
            caustic: self.caustic[pixel],
            indirect: self.indirect[pixel],
        }
    }

    /// Returns the picture: in each pixel (((emitted + direct) + specular) + caustic) + indirect, in this order, so
    /// that the terms sum to it bit for bit.
    #[must_use]
    pub fn picture(&self) -> Vec<Vec3> {
        (0..self.pixel_count()).map(|pixel| self.terms(pixel).sum()).collect()
    }

    /// Mixes another film of the same size in, so that it is this `share` of the whole. Depths are mixed where both
    /// have one.
    pub(crate) fn mix(&mut self, other: &Self, share: f32) {
        let planes = [
            (&mut self.emitted, &other.emitted),
            (&mut self.direct, &other.direct),
            (&mut self.specular, &other.specular),
            (&mut self.caustic, &other.caustic),
            (&mut self.indirect, &other.indirect),
            (&mut self.albedo, &other.albedo),
            (&mut self.normal, &other.normal),
        ];
        for (plane, other) in planes {
            for (value, other) in plane.iter_mut().zip(other) {
                *value = value.lerp(*other, share);
            }
        }
        let alphas = self.alpha.iter().zip(&other.alpha);
        for ((depth, &other), (alpha, other_alpha)) in self.depth.iter_mut().zip(&other.depth).zip(alphas) {
            // They are means over what shows a surface.
            let (own, others) = ((1.0 - share) * alpha, share * other_alpha);
            *depth = if depth.is_finite() && other.is_finite() {
                *depth + (other - *depth) * (others / (own + others))
            } else {
                depth.min(other)
            };
        }
        for (alpha, &other) in self.alpha.iter_mut().zip(&other.alpha) {
            *alpha += (other - *alpha) * share;
        }
        if let Some(others) = &other.rungs {
            let own = self.rungs.get_or_insert_with(|| vec![Rungs::default(); others.len()]);
            own.iter_mut().zip(others).for_each(|(own, other)| own.mix(*other, share));
        }
    }

    /// Returns the film cut into bands of `rows` rows (the last may be lower), from the top.
    ///
    /// # Panics
    ///
    /// When `rows` is 0.
    #[must_use]
    pub(crate) fn bands_mut(&mut self, rows: u32) -> Vec<Band<'_>> {
        assert!(rows > 0, "a band has at least one row");
        let width = self.size.x;
        let length = (rows as usize * width as usize).max(1);
        let planes = [
            &mut self.emitted,
            &mut self.direct,
            &mut self.specular,
            &mut self.caustic,
            &mut self.indirect,
            &mut self.albedo,
            &mut self.normal,
        ];
        let mut planes = planes.map(|plane| plane.chunks_mut(length));
        let scalars = self.depth.chunks_mut(length).zip(self.alpha.chunks_mut(length));
        let mut rungs = self.rungs.as_deref_mut().unwrap_or_default().chunks_mut(length);
        let first_rows = (0u32..).step_by(rows as usize);
        first_rows
            .zip(scalars)
            .map(|(first_row, (depth, alpha))| {
                let [emitted, direct, specular, caustic, indirect, albedo, normal] =
                    planes.each_mut().map(|plane| plane.next().unwrap_or_default());
                let rungs = rungs.next().unwrap_or_default();
                Band {
                    first_row,
                    width,
                    emitted,
                    direct,
                    specular,
                    caustic,
                    indirect,
                    albedo,
                    normal,
                    depth,
                    alpha,
                    rungs,
                }
            })
            .collect()
    }
}

impl Band<'_> {
    /// Returns the number of its pixels.
    #[must_use]
    pub(crate) fn pixel_count(&self) -> usize {
        self.depth.len()
    }

    /// Returns the film coordinates of the upper left corner of its pixel number `index`.
    #[must_use]
    pub(crate) fn position(&self, index: usize) -> UVec2 {
        #[expect(clippy::cast_possible_truncation, reason = "a film has at most 2^28 pixels")]
        let index = index as u32;
        UVec2::new(index % self.width, self.first_row + index / self.width)
    }

    /// Returns the number in the whole film of its pixel number `index`.
    #[must_use]
    pub(crate) fn film_index(&self, index: usize) -> usize {
        self.first_row as usize * self.width as usize + index
    }

    /// Writes pixel number `index` of the band.
    ///
    /// # Panics
    ///
    /// When `index` is not below [`Band::pixel_count`].
    pub(crate) fn set(&mut self, index: usize, pixel: &Pixel) {
        self.emitted[index] = pixel.terms.emitted;
        self.direct[index] = pixel.terms.direct;
        self.specular[index] = pixel.terms.specular;
        self.caustic[index] = pixel.terms.caustic;
        self.indirect[index] = pixel.terms.indirect;
        self.albedo[index] = pixel.albedo;
        self.normal[index] = pixel.normal;
        self.depth[index] = pixel.depth;
        self.alpha[index] = pixel.alpha;
    }

    /// Changes the direct light of pixel number `index` of the band, down to none.
    ///
    /// # Panics
    ///
    /// When `index` is not below [`Band::pixel_count`].
    pub(crate) fn change_direct(&mut self, index: usize, change: Vec3) {
        let direct = &mut self.direct[index];
        *direct = (*direct + change).max(Vec3::ZERO);
    }

    /// Writes how pixel number `index` of the band got its indirect light, if anybody asks.
    pub(crate) fn set_rungs(&mut self, index: usize, rungs: Rungs) {
        if let Some(place) = self.rungs.get_mut(index) {
            *place = rungs;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_the_film_once() {
        let mut film = Film::new(UVec2::new(3, 5));
        assert_eq!(film.memory_bytes(), 15 * 92, "as documented");
        for band in &mut film.bands_mut(2) {
            for index in 0..band.pixel_count() {
                let position = band.position(index);
                assert_eq!(band.film_index(index), (position.y * 3 + position.x) as usize, "row by row");
                let value = position.as_vec2().extend(1.0);
                let mut sum = PixelSum::default();
                sum.add_terms(&Terms { caustic: value, ..Terms::default() });
                band.set(index, &sum.mean(1));
            }
        }
        let expected: Vec<_> = (0..15).map(|i| Vec3::new((i % 3) as f32, (i / 3) as f32, 1.0)).collect();
        assert_eq!(film.caustic, expected, "each pixel has its own value");
        assert_eq!(film.picture(), expected, "the other terms are black");
    }

    #[test]
    fn mixed_films_are_means() {
        let film = |value: f32, depth: f32| {
            let mut film = Film::new(UVec2::ONE);
            (film.indirect[0], film.depth[0], film.alpha[0]) = (Vec3::splat(value), depth, value);
            film
        };
        let mut mixed = Film::new(UVec2::ONE);
        mixed.mix(&film(4.0, f32::INFINITY), 1.0);
        assert_eq!(mixed, film(4.0, f32::INFINITY), "the first is all of it");
        mixed.mix(&film(0.0, 3.0), 0.25);
        assert_eq!(mixed, film(3.0, 3.0), "three to one, and a depth where one has it");
        mixed.mix(&film(3.0, 7.0), 0.25);
        assert_eq!(mixed.depth, [4.0], "three to one");
        mixed.mix(&film(1.0, 12.0), 0.5);
        assert_eq!(mixed.depth, [6.0], "by how much of the pixel each saw: three to one again");
    }

    #[test]
    fn means_count_what_was_missed() {
        let mut sum = PixelSum::default();
        let direct = Vec3::new(1.0, 2.0, 3.0);
        sum.add_terms(&Terms { direct, ..Terms::default() });
        sum.add_hit(&FirstHit { albedo: Vec3::splat(0.5), normal: Vec3A::Z, depth: 7.0 });
        let pixel = sum.mean(4);
        assert_eq!(pixel.terms.direct, direct / 4.0, "three samples saw nothing");
        assert_eq!((pixel.depth, pixel.alpha), (7.0, 0.25), "depth is that of the part that is there");
        assert_eq!(PixelSum::default().mean(4).depth, f32::INFINITY, "a miss");
    }
}
