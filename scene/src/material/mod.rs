//! How a surface reflects: the sum of a diffuse and a specular part, f = f_d + f_s (paper, eq. 5).
//!
//! Directions are unit vectors in the local frame whose z is the shading normal on the viewer's side; `wo` goes to the
//! viewer (wo.z > 0), `wi` to the light. `eval` does not hold the cosine. Perfect reflection and refraction are delta
//! lobes: `eval` and `pdf` do not see them, only `sample` and [`Bsdf::delta_branches`] do.

mod dielectric;
mod ggx;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3, Vec3A};

pub use dielectric::fresnel_dielectric;

/// A choice of the parts of a [`Bsdf`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lobes(u8);

impl Lobes {
    /// The diffuse part.
    pub const DIFFUSE: Self = Self(1);
    /// The specular part: gloss, mirror, glass.
    pub const SPECULAR: Self = Self(2);
    /// Both.
    pub const ALL: Self = Self(3);

    /// Whether this choice holds all of `other`.
    #[inline]
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// How a point of a surface reflects and refracts, textures looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bsdf {
    /// Albedo of the diffuse part; its f is albedo / pi.
    pub diffuse: Vec3,
    /// The specular part.
    pub specular: Specular,
}

/// The specular part of a [`Bsdf`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Specular {
    /// None.
    None,
    /// A rough surface of GGX microfacets.
    Ggx {
        /// Width of the distribution of normals, in (0, 1].
        alpha: f32,
        /// Constant factor, or reflectance at normal incidence where `schlick` is set.
        reflectance: Vec3,
        /// Whether the reflectance rises by Schlick's formula, at grazing angles to what the diffuse part leaves of 1.
        schlick: bool,
    },
    /// A perfect mirror.
    Mirror {
        /// Share of the light that is reflected.
        reflectance: Vec3,
    },
    /// A smooth boundary between two dielectrics.
    Dielectric {
        /// Refractive index beyond the surface over that on the side of `wo`.
        eta: f32,
        /// Factor for light that passes.
        tint: Vec3,
    },
}

/// A direction chosen by [`Bsdf::sample`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// The direction, unit, local frame; wi.z < 0 where it passes the surface.
    pub wi: Vec3A,
    /// f |cos| / pdf for radiance; for a delta lobe its share over the probability of the choice.
    pub weight: Vec3,
    /// Density per steradian over all lobes that were asked for; 0 for a delta lobe.
    pub pdf: f32,
    /// Whether this direction is that of a delta lobe.
    pub delta: bool,
    /// Whether it passes the surface.
    pub transmitted: bool,
    /// The part of `weight` by which radiance, unlike flux, changes when it is refracted: 1 / eta^2, else 1. Photons
    /// carry flux: divide by it.
    pub radiance_scale: f32,
}

impl Bsdf {
    /// Black: absorbs everything.
    pub const BLACK: Self = Self { diffuse: Vec3::ZERO, specular: Specular::None };

    /// Returns f(wo, wi) per steradian, without the cosine and without delta lobes; 0 unless both are above the
    /// surface.
    #[inline]
    #[must_use]
    pub fn eval(&self, lobes: Lobes, wo: Vec3A, wi: Vec3A) -> Vec3 {
        if !(above(wo) && above(wi)) {
            return Vec3::ZERO;
        }
        let mut f = Vec3::ZERO;
        if lobes.contains(Lobes::DIFFUSE) {
            f += self.diffuse * FRAC_1_PI;
        }
        if lobes.contains(Lobes::SPECULAR)
            && let Specular::Ggx { alpha, .. } = self.specular
        {
            let h = (wo + wi).normalize();
            f += self.fresnel(wo.dot(h)) * ggx::eval(alpha, wo, wi, h);
        }
        f
    }

    /// Returns the density with which [`Bsdf::sample`] of the same lobes chooses `wi`, per steradian; delta lobes do
    /// not count.
    #[inline]
    #[must_use]
    pub fn pdf(&self, lobes: Lobes, wo: Vec3A, wi: Vec3A) -> f32 {
        if !(above(wo) && above(wi)) {
            return 0.0;
        }
        let specular = self.specular_probability(lobes, wo);
        let mut pdf = 0.0;
        // Where there is neither part the probability of the specular one is 0, and yet nothing is diffuse.
        if lobes.contains(Lobes::DIFFUSE) && self.has_diffuse() {
            pdf += (1.0 - specular) * wi.z * FRAC_1_PI;
        }
        if specular > 0.0
            && let Specular::Ggx { alpha, .. } = self.specular
        {
            pdf += specular * ggx::pdf(alpha, wo, (wo + wi).normalize());
        }
        pdf
    }

    /// Returns [`Bsdf::eval`] and [`Bsdf::pdf`], for less than both take one after the other.
    #[inline]
    #[must_use]
    pub fn eval_pdf(&self, lobes: Lobes, wo: Vec3A, wi: Vec3A) -> (Vec3, f32) {
        if !(above(wo) && above(wi)) {
            return (Vec3::ZERO, 0.0);
        }
        let specular = self.specular_probability(lobes, wo);
        let (mut f, mut pdf) = (Vec3::ZERO, 0.0);
        if lobes.contains(Lobes::DIFFUSE) && self.has_diffuse() {
            f += self.diffuse * FRAC_1_PI;
            pdf += (1.0 - specular) * wi.z * FRAC_1_PI;
        }
        if lobes.contains(Lobes::SPECULAR)
            && let Specular::Ggx { alpha, .. } = self.specular
        {
            let h = (wo + wi).normalize();
            let density = ggx::pdf(alpha, wo, h);
            f += self.fresnel(wo.dot(h)) * (density * ggx::masking_over_cosine(alpha, wi));
            pdf += specular * density;
        }
        (f, pdf)
    }

    /// Chooses a direction for `wo` among `lobes`, by about their share of the energy; `None` where nothing is
    /// reflected there.
    ///
    /// `u_lobe` chooses the lobe (for a dielectric: reflection or refraction), `u` the direction.
    #[inline]
    #[must_use]
    pub fn sample(&self, lobes: Lobes, wo: Vec3A, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if !above(wo) {
            return None;
        }
        let specular = self.specular_probability(lobes, wo);
        if u_lobe < specular {
            match self.specular {
                Specular::None => None,
                Specular::Ggx { alpha, .. } => self.rough_sample(lobes, wo, ggx::sample(alpha, wo, u)),
                Specular::Mirror { reflectance } => Some(mirrored(wo, reflectance / specular)),
                Specular::Dielectric { eta, tint } => {
                    // The lobe was chosen by u_lobe < specular: what is left of it is uniform again.
                    let (reflected, refracted) = dielectric::branches(eta, tint, wo);
                    let share = reflected.weight.x;
                    let chosen = if u_lobe / specular < share {
                        BsdfSample { weight: Vec3::ONE / specular, ..reflected }
                    } else {
                        let refracted = refracted?;
                        BsdfSample { weight: refracted.weight / ((1.0 - share) * specular), ..refracted }
                    };
                    Some(chosen)
                }
            }
        } else if lobes.contains(Lobes::DIFFUSE) && self.diffuse != Vec3::ZERO {
            self.rough_sample(lobes, wo, hemimap::square_to_cosine_hemisphere(u))
        } else {
            None
        }
    }

    /// Whether there is a delta lobe, be it over a diffuse part.
    #[inline]
    #[must_use]
    pub fn has_delta(&self) -> bool {
        matches!(self.specular, Specular::Mirror { .. } | Specular::Dielectric { .. })
    }

    /// Whether there is no lobe but a delta one.
    #[inline]
    #[must_use]
    pub fn is_delta(&self) -> bool {
        !self.has_diffuse() && self.has_delta()
    }

    /// Whether there is a diffuse part.
    #[inline]
    #[must_use]
    pub fn has_diffuse(&self) -> bool {
        self.diffuse != Vec3::ZERO
    }

    /// Whether any of the lobes may reflect light from a direction that light sampling chose: a diffuse or a rough
    /// specular one. On mirrors and glass, and on what is black, light sampling is in vain.
    ///
    /// ```
    /// use scene::glam::Vec3;
    /// use scene::{Bsdf, Lobes, Specular};
    ///
    /// let chalk = Bsdf { diffuse: Vec3::splat(0.8), specular: Specular::None };
    /// assert!(chalk.scatters(Lobes::ALL) && !chalk.scatters(Lobes::SPECULAR));
    /// ```
    #[inline]
    #[must_use]
    pub fn scatters(&self, lobes: Lobes) -> bool {
        lobes.contains(Lobes::DIFFUSE) && self.has_diffuse() || lobes.contains(Lobes::SPECULAR) && self.has_glossy()
    }

    /// Whether [`Bsdf::sample`] of all lobes asks `u_lobe`: there are two parts, or a surface that both reflects and
    /// refracts.
    #[inline]
    #[must_use]
    pub fn has_choice(&self) -> bool {
        match self.specular {
            Specular::None => false,
            Specular::Ggx { .. } | Specular::Mirror { .. } => self.has_diffuse(),
            Specular::Dielectric { .. } => true,
        }
    }

    /// Whether there is a rough specular part.
    #[inline]
    #[must_use]
    pub fn has_glossy(&self) -> bool {
        matches!(self.specular, Specular::Ggx { .. })
    }

    /// Returns the delta lobes' directions with their shares as weights (Fresnel included): reflection, then
    /// refraction.
    #[inline]
    #[must_use]
    pub fn delta_branches(&self, wo: Vec3A) -> [Option<BsdfSample>; 2] {
        match self.specular {
            _ if !above(wo) => [None, None],
            Specular::Mirror { reflectance } => [Some(mirrored(wo, reflectance)), None],
            Specular::Dielectric { eta, tint } => {
                let (reflected, refracted) = dielectric::branches(eta, tint, wo);
                [Some(reflected), refracted]
            }
            Specular::None | Specular::Ggx { .. } => [None, None],
        }
    }

    /// Returns the sample for a direction that a lobe other than a delta one gave.
    #[inline]
    fn rough_sample(&self, lobes: Lobes, wo: Vec3A, wi: Vec3A) -> Option<BsdfSample> {
        let (f, pdf) = self.eval_pdf(lobes, wo, wi);
        let weight = f * (wi.z / pdf);
        (pdf > 0.0).then_some(BsdfSample { wi, weight, pdf, delta: false, transmitted: false, radiance_scale: 1.0 })
    }

    /// Returns the probability that [`Bsdf::sample`] takes the specular part among `lobes`: about its share of the
    /// energy, 0 where there is none and 1 where there is no other.
    #[inline]
    #[must_use]
    pub fn specular_probability(&self, lobes: Lobes, wo: Vec3A) -> f32 {
        if !lobes.contains(Lobes::SPECULAR) {
            return 0.0;
        }
        let specular = match self.specular {
            Specular::None => return 0.0,
            Specular::Ggx { .. } => self.fresnel(wo.z),
            Specular::Mirror { reflectance } => reflectance,
            Specular::Dielectric { .. } => Vec3::ONE,
        };
        let diffuse = if lobes.contains(Lobes::DIFFUSE) { self.diffuse.element_sum() } else { 0.0 };
        let specular = specular.element_sum();
        if specular > 0.0 { specular / (specular + diffuse) } else { 0.0 }
    }

    /// Returns the factor of the microfacets at a cosine with their normal.
    ///
    /// Schlick's formula rises to 1 - diffuse, not to 1, so that both parts together never reflect more than they
    /// receive.
    #[inline]
    fn fresnel(&self, cosine: f32) -> Vec3 {
        match self.specular {
            Specular::Ggx { reflectance, schlick: true, .. } => {
                let x = (1.0 - cosine).clamp(0.0, 1.0);
                let x_sq = x * x;
                let grazing = (Vec3::ONE - self.diffuse).max(reflectance);
                reflectance + (grazing - reflectance) * (x_sq * x_sq * x)
            }
            Specular::Ggx { reflectance, schlick: false, .. } => reflectance,
            Specular::None | Specular::Mirror { .. } | Specular::Dielectric { .. } => Vec3::ZERO,
        }
    }
}

/// Whether a direction is above the surface; NaN is not.
#[inline]
fn above(w: Vec3A) -> bool {
    w.z > 0.0
}

/// Returns the mirror direction with a given weight.
#[inline]
fn mirrored(wo: Vec3A, weight: Vec3) -> BsdfSample {
    let wi = Vec3A::new(-wo.x, -wo.y, wo.z);
    BsdfSample { wi, weight, pdf: 0.0, delta: true, transmitted: false, radiance_scale: 1.0 }
}
