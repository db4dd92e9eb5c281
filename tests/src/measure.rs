//! Small pictures, divided by what is known of them.

use glam::{DVec3, UVec2, Vec2, Vec3};
use integrator::{Film, Method, Settings, Study, render};
use scene::Scene;

/// Side of the blocks whose means are judged, pixels.
const BLOCK: u32 = 4;

/// Every way to make a picture.
pub const METHODS: [Method; 4] = [Method::Path, Method::Gather, Method::Reproject, Method::CacheOnly];

/// The part of a picture that is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// The sum of all.
    All,
    /// Light that comes straight.
    Direct,
    /// Diffuse light that was reflected before.
    Indirect,
    /// Diffuse light focused by mirrors and glass.
    Caustic,
    /// All that the specular part reflects but lamps.
    Specular,
}

impl Term {
    /// Returns the term of a film.
    #[must_use]
    pub fn of(self, film: &Film) -> Vec<Vec3> {
        match self {
            Self::All => film.picture(),
            Self::Direct => film.direct.clone(),
            Self::Indirect => film.indirect.clone(),
            Self::Caustic => film.caustic.clone(),
            Self::Specular => film.specular.clone(),
        }
    }
}

/// What pictures may cost.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Width and height, pixels.
    pub side: u32,
    /// Pictures with seeds of their own.
    pub seeds: u64,
    /// Samples a pixel of the path tracer.
    pub path_spp: u32,
    /// Primary samples a pixel of the other methods.
    pub spp: u32,
    /// Quality of the other methods.
    pub quality: f32,
    /// Whether these fit direct light over neighbouring pixels, whose spread then no longer tells the noise of their
    /// mean.
    pub direct_fit: bool,
}

impl Default for Effort {
    fn default() -> Self {
        Self { side: 16, seeds: 4, path_spp: 64, spp: 16, quality: 0.25, direct_fit: false }
    }
}

/// Renders one picture.
///
/// # Panics
/// If the effort is out of the range of the settings, or a sample was not finite.
#[must_use]
pub fn film(scene: &Scene, method: Method, effort: &Effort, seed: u64) -> Film {
    let spp = if method == Method::Path { effort.path_spp } else { effort.spp };
    let size = UVec2::splat(effort.side);
    let study = Study { direct_fit: Some(effort.direct_fit), ..Study::default() };
    let settings =
        Settings { method, quality: effort.quality, spp: Some(spp), size, seed, study, ..Settings::default() };
    let rendering = render(scene, &settings, &|_| ()).expect("valid settings");
    assert_eq!(rendering.statistics.dropped_samples, 0, "samples that are not finite");
    rendering.film
}

/// Pictures of a scene by one method, a seed each, and the places that they show.
#[derive(Debug)]
pub struct Pictures {
    /// The pictures.
    pub films: Vec<Film>,
    /// The point of a surface in the middle of each pixel; `None` where there is nothing.
    pub points: Vec<Option<DVec3>>,
    method: Method,
    side: u32,
}

impl Pictures {
    /// Renders a picture a seed.
    ///
    /// # Panics
    /// As [`film`] does.
    #[must_use]
    pub fn new(scene: &Scene, method: Method, effort: &Effort) -> Self {
        let Effort { side, seeds, .. } = *effort;
        let points = (0..side * side).map(|pixel| {
            let film = Vec2::new((pixel % side) as f32, (pixel / side) as f32) + 0.5;
            let ray = scene.camera_ray(film, UVec2::splat(side));
            scene.intersect(&ray).map(|hit| scene.surface(&ray, &hit).p.as_dvec3())
        });
        let points = points.collect();
        Self { films: (0..seeds).map(|seed| film(scene, method, effort, seed)).collect(), points, method, side }
    }

    /// Divides the red of a term by `known`, the radiance that it should send from a point to the eye.
    ///
    /// # Panics
    /// If the middle of a pixel shows nothing.
    #[must_use]
    pub fn relative(&self, term: Term, known: impl Fn(DVec3) -> f64) -> Measured {
        let known: Vec<f64> = self.points.iter().map(|p| known(p.expect("the picture is full"))).collect();
        let across = self.side.div_ceil(BLOCK) as usize;
        let mut blocks = vec![(0.0, 0.0); across * across];
        let (mut sum, mut sum_sq) = (0.0, 0.0);
        for film in &self.films {
            for (number, (radiance, known)) in (0u32..).zip(term.of(film).iter().zip(&known)) {
                // About 0, so that the variance keeps its digits.
                let error = f64::from(radiance.x) / known - 1.0;
                sum += error;
                sum_sq += error * error;
                let (x, y) = (number % self.side / BLOCK, number / self.side / BLOCK);
                let block = &mut blocks[y as usize * across + x as usize];
                *block = (block.0 + error, block.1 + 1.0);
            }
        }
        let count = known.len() as f64 * self.films.len() as f64;
        let mean = sum / count;
        let variance = (sum_sq / count - mean * mean).max(0.0) * count / (count - 1.0);
        let worst = blocks.iter().map(|(sum, count): &(f64, f64)| (sum / count).abs()).fold(0.0, f64::max);
        Measured { mean: 1.0 + mean, standard_error: (variance / count).sqrt(), worst, method: self.method }
    }
}

/// Renders a scene and divides its pictures by `known`, the radiance that a point sends to the eye.
///
/// # Panics
/// As [`film`] does, and if the middle of a pixel shows nothing.
#[must_use]
pub fn measure(scene: &Scene, method: Method, effort: &Effort, known: impl Fn(DVec3) -> f64) -> Measured {
    Pictures::new(scene, method, effort).relative(Term::All, known)
}

/// A term relative to what is known: 1 is right.
#[derive(Debug, Clone, Copy)]
pub struct Measured {
    /// Mean over pixels and seeds.
    pub mean: f64,
    /// Standard error of `mean` from the spread over all pixels and seeds. It holds where pixels are independent,
    /// which they are not where direct light is fitted.
    pub standard_error: f64,
    /// Largest deviation from 1 of the mean of a block of 4 x 4 pixels over the seeds: single pixels of small pictures
    /// are noise.
    pub worst: f64,
    method: Method,
}

/// Shows what was measured; `cargo test -- --nocapture` lets it through.
pub fn print(text: &str) {
    #[expect(clippy::print_stdout, reason = "for those who ask for it")]
    {
        println!("{text}");
    }
}

impl Measured {
    /// Asserts that the mean is 1 but for noise: 4.5 standard errors (p = 7e-6), which are at most 0.5 % in themselves,
    /// or the test would say nothing. Where there is no noise, f32 leaves 1e-5.
    ///
    /// # Panics
    /// If it is not.
    pub fn assert_unbiased(&self, what: &str) {
        let Self { mean, standard_error, method, .. } = *self;
        print(&format!("{what}, {}: {mean:.6} +- {standard_error:.6}", method.name()));
        let text =
            format!("{what}, {}: {mean:.6} times what it should be, standard error {standard_error:.6}", method.name());
        assert!(standard_error <= 5e-3, "{text}: too large to say anything");
        assert!((mean - 1.0).abs() <= 4.5 * standard_error + 1e-5, "{text}");
    }

    /// Asserts what a method with a cache promises: the mean is within 1 % and the worst block within 5 %.
    ///
    /// # Panics
    /// If they are not.
    pub fn assert_cached(&self, what: &str) {
        let Self { mean, worst, method, .. } = *self;
        print(&format!("{what}, {}: {mean:.6}, worst block {worst:.4}", method.name()));
        let text =
            format!("{what}, {}: {mean:.6} times what it should be, worst block off by {worst:.4}", method.name());
        assert!((mean - 1.0).abs() <= 0.01 && worst <= 0.05, "{text}");
    }

    /// Asserts the one or the other: the path tracer has no bias, the other methods a small one.
    ///
    /// # Panics
    /// If it does not hold.
    pub fn assert_holds(&self, what: &str) {
        if self.method == Method::Path {
            self.assert_unbiased(what);
        } else {
            self.assert_cached(what);
        }
    }
}
