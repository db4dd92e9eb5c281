//! The study scenes with their converged references, and the test of a picture against one.

use std::path::{Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers, read};
use glam::{DVec3, UVec2, Vec3};
use integrator::metrics::Image;
use scene::{Camera, LoadOptions, Scene, load};

/// Side of the references, pixels.
const SIDE: usize = 256;

/// Width and height of the references, pixels.
pub const STUDY_SIZE: UVec2 = UVec2::splat(256);

/// Returns the folder of the scenes that come with the sources.
#[must_use]
pub fn data_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data")
}

/// Whether the long versions of tests were asked for by `FREELUX_FULL=1`.
#[must_use]
pub fn is_full() -> bool {
    std::env::var_os("FREELUX_FULL").is_some_and(|value| value == "1")
}

/// A study scene and its reference.
#[derive(Debug)]
pub struct Study {
    /// The scene with the camera of the reference.
    pub scene: Scene,
    /// Radiance.
    pub reference: Vec<Vec3>,
    /// Variance of the numbers in `reference`.
    pub variance: Vec<Vec3>,
    /// relMSE of the reference itself, exposed.
    pub own_error: f64,
}

impl Study {
    /// Opens `cornell`, `cornell-glossy` or `atrium-env`.
    ///
    /// # Panics
    /// If there is no such scene, or its files are damaged.
    #[must_use]
    pub fn open(name: &str) -> Self {
        // Cameras and errors are those of `data/study/README.md`.
        let box_eye = Vec3::new(278.0, 273.0, -800.0);
        let (eye, at, fov_y_degrees, own_error) = match name {
            "cornell" => (box_eye, box_eye + Vec3::Z, 39.307_648, 1.3e-4),
            "cornell-glossy" => (box_eye, box_eye + Vec3::Z, 39.307_648, 3.8e-4),
            "atrium-env" => (Vec3::new(-3.6, 1.6, 2.4), Vec3::new(2.2, 1.25, -1.0), 60.0, 7.5e-4),
            _ => panic!("no study scene is named {name}"),
        };
        let folder = data_folder().join("study").join(name);
        let environment = folder.join("env.exr");
        let environment = environment.exists().then_some(environment);
        let options = LoadOptions { environment, ..LoadOptions::default() };
        let mut description = load(&folder.join("scene.obj"), &options).expect("a sound scene").description;
        description.camera = Some(Camera { eye, at, up: Vec3::Y, fov_y_degrees });
        Self {
            scene: Scene::new(description).expect("a valid scene"),
            reference: read_exr(&folder.join("reference.exr")),
            variance: read_exr(&folder.join("variance.exr")),
            own_error,
        }
    }

    /// Returns the reference as the measures of error take it.
    ///
    /// # Panics
    /// If the reference is not of the stated size.
    #[must_use]
    pub fn image(&self) -> Image<'_> {
        Image::new(STUDY_SIZE, &self.reference).expect("a picture of 256 x 256")
    }
}

fn read_exr(path: &Path) -> Vec<Vec3> {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |_, _| vec![Vec3::ZERO; SIDE * SIDE],
            |pixels: &mut Vec<Vec3>, position, (r, g, b): (f32, f32, f32)| {
                pixels[position.y() * SIDE + position.x()] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(path);
    image.unwrap_or_else(|error| panic!("{}: {error}", path.display())).layer_data.channel_data.pixels
}

/// Relative difference that is not noise: `env.exr` was resampled from the rows that the reference's renderer looks up
/// (`data/study/README.md`). At the horizon of `atrium-env` that leaves 4e-4, the same in every picture.
const FILTERING: f64 = 4e-4;

/// How far the mean of independent pictures is from a reference, in standard errors, over square blocks of pixels.
///
/// The error of a block comes from the spread of its pixels over the pictures and from the variance of the reference.
/// With k pictures and blocks of b pixels it has about (k - 1) b degrees of freedom, so that z is nearly normal if the
/// tails are not heavy. Blocks through which the sky is seen have hardly any spread; what two renderers make of its
/// texels differs there, for which `FILTERING` allows.
#[derive(Debug, Clone, Copy)]
pub struct Blocks {
    /// Largest |z| over all blocks and channels.
    pub worst: f64,
    /// Mean of z^2, 1 for a picture without bias.
    pub mean_sq: f64,
    /// Number of blocks times channels that have any light.
    pub count: usize,
    /// Picture over reference in the mean of all pixels, for each channel.
    pub ratio: DVec3,
    /// Standard error of `ratio`.
    pub ratio_error: DVec3,
}

impl Blocks {
    /// Compares, with the reference multiplied by `factor`: another factor than 1 plants an error.
    ///
    /// # Panics
    /// If there are fewer than two pictures, or `block` does not divide 256.
    #[must_use]
    pub fn compare(study: &Study, pictures: &[Vec<Vec3>], block: usize, factor: f64) -> Self {
        assert!(pictures.len() > 1 && SIDE.is_multiple_of(block), "two pictures, whole blocks");
        let k = pictures.len() as f64;
        let across = SIDE / block;
        // Sums over the pixels of a block: difference, its variance, reference.
        let mut sums = vec![(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO); across * across];
        let (mut light, mut total, mut total_variance) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for pixel in 0..SIDE * SIDE {
            let values = || pictures.iter().map(|picture| picture[pixel].as_dvec3());
            let mean = values().sum::<DVec3>() / k;
            let spread = values().map(|value| (value - mean) * (value - mean)).sum::<DVec3>() / (k - 1.0);
            let variance = spread / k + study.variance[pixel].as_dvec3() * factor * factor;
            let reference = study.reference[pixel].as_dvec3() * factor;
            let sum = &mut sums[pixel / SIDE / block * across + pixel % SIDE / block];
            sum.0 += mean - reference;
            sum.1 += variance;
            sum.2 += reference;
            light += reference;
            total += mean;
            total_variance += variance;
        }
        let z: Vec<f64> = sums
            .iter()
            .flat_map(|(difference, variance, light)| (0..3).map(|c| (difference[c], variance[c], light[c])))
            .filter(|&(_, variance, _)| variance > 0.0)
            .map(|(difference, variance, light)| difference / (variance + (FILTERING * light).powi(2)).sqrt())
            .collect();
        Self {
            worst: z.iter().map(|z| z.abs()).fold(0.0, f64::max),
            mean_sq: z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64,
            count: z.len(),
            ratio: total / light,
            ratio_error: total_variance.powf(0.5) / light,
        }
    }

    /// Returns the largest |z| of the whole mean over the channels.
    #[must_use]
    pub fn whole(&self) -> f64 {
        ((self.ratio - 1.0) / self.ratio_error).abs().max_element()
    }
}
