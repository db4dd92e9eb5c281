//! The maps as sampling methods: chi-squared against their densities, and moments in closed form.

use crate::random::Random;
use hemimap::glam::{DVec2, DVec3, Vec3A};
use hemimap::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

const ROWS: u32 = 20;
const COLUMNS: u32 = 40;
const SAMPLES: u32 = 1_000_000;

/// Chi-squared of the samples over cells of equal probability, `height` uniform in [0, 1] where the density is right.
fn chi_squared(mut sample: impl FnMut() -> Vec3A, height: fn(f32) -> f32) -> f64 {
    let mut cells = vec![0_u32; (ROWS * COLUMNS) as usize];
    for _ in 0..SAMPLES {
        let w = sample();
        let phi = w.y.atan2(w.x) / (2.0 * std::f32::consts::PI) + 0.5;
        let cell = texel_index(height(w.z), ROWS) * COLUMNS + texel_index(phi, COLUMNS);
        cells[cell as usize] += 1;
    }
    let expected = f64::from(SAMPLES) / f64::from(ROWS * COLUMNS);
    cells.iter().map(|count| (f64::from(*count) - expected).powi(2) / expected).sum()
}

/// Ten tests at 1 % together (Sidak): each at 1 - 0.99^(1/10).
fn critical_value() -> f64 {
    let chi = ChiSquared::new(f64::from(ROWS * COLUMNS - 1)).expect("degrees of freedom are positive");
    chi.inverse_cdf(0.99f64.powf(0.1))
}

#[test]
fn samples_pass_chi_squared() {
    let critical = critical_value();
    assert!((critical - 928.19).abs() < 0.05, "critical value {critical}");
    for seed in 0..5 {
        let mut random = Random(seed);
        let cosine = chi_squared(|| square_to_cosine_hemisphere(random.square()), |z| z * z);
        assert!(cosine < critical, "cosine, seed {seed}: {cosine}");
        let uniform = chi_squared(|| square_to_uniform_hemisphere(random.square()), |z| z);
        assert!(uniform < critical, "uniform, seed {seed}: {uniform}");
    }
}

#[test]
fn chi_squared_finds_a_density_off_by_five_percent() {
    let mut random = Random(7);
    let planted = chi_squared(
        || loop {
            let w = square_to_cosine_hemisphere(random.square());
            // A density of 1 + 0.05 cos(3 phi), by rejection.
            let phi = w.y.atan2(w.x);
            if random.unit() * 1.05 < 1.0 + 0.05 * (3.0 * phi).cos() {
                return w;
            }
        },
        |z| z * z,
    );
    assert!(planted > critical_value(), "a planted error passes: {planted}");
    let mut random = Random(8);
    let wrong = chi_squared(|| square_to_uniform_hemisphere(random.square()), |z| z * z);
    assert!(wrong > critical_value(), "the wrong map passes: {wrong}");
}

/// The mean of `f` over the directions of the centres of n x n texels.
fn grid_mean(n: u32, map: fn(DVec2) -> DVec3, f: impl Fn(DVec3) -> f64) -> f64 {
    let centre = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    let rows = (0..n).map(|j| (0..n).map(|i| f(map(DVec2::new(centre(i), centre(j))))).sum::<f64>());
    rows.sum::<f64>() / f64::from(n * n)
}

#[test]
fn moments_on_a_grid_have_their_known_errors() {
    let map = double::square_to_cosine_hemisphere;
    for (n, z_error) in [(16, 8.5901e-3), (32, 2.9594e-3), (64, 1.0227e-3)] {
        let square = f64::from(n * n);
        let off = grid_mean(n, map, |w| w.z * w.z) - 0.5;
        assert!((off.abs() - 1.0 / square).abs() < 1e-12, "z^2, n = {n}: {off:e}");
        let off = grid_mean(n, map, |w| w.x * w.x) - 0.25;
        assert!((off + 0.5 / square).abs() < 1e-12, "x^2, n = {n}: {off:e}");
        let off = grid_mean(n, map, |w| w.z) - 2.0 / 3.0;
        assert!((off.abs() - z_error).abs() < 6e-8, "z, n = {n}: {off:e}");
        let off = grid_mean(n, double::square_to_uniform_hemisphere, |w| w.z) - 0.5;
        assert!((off - 0.5 / square * 2.0).abs() < 1e-12, "uniform z, n = {n}: {off:e}");
    }
}

#[test]
fn moments_are_exact() {
    type Moment = (&'static str, fn(DVec3) -> f64, f64, f64);
    // What, cosine, uniform.
    let even: [Moment; 4] = [
        ("z^2", |w| w.z.powi(2), 0.5, 1.0 / 3.0),
        ("x^2", |w| w.x.powi(2), 0.25, 1.0 / 3.0),
        ("x^4", |w| w.x.powi(4), 0.125, 0.2),
        ("x^2 y^2", |w| (w.x * w.y).powi(2), 1.0 / 24.0, 1.0 / 15.0),
    ];
    for (map, uniform) in [
        (double::square_to_cosine_hemisphere as fn(DVec2) -> DVec3, false),
        (double::square_to_uniform_hemisphere, true),
    ] {
        for (name, f, c, u) in even {
            let exact = if uniform { u } else { c };
            let off = [128, 256].map(|n| grid_mean(n, map, f) - exact);
            // Second order: what is left at n falls as 1/n^2, so that the extrapolation is better by far.
            let limit = (4.0 * off[1] - off[0]) / 3.0;
            assert!(off[1].abs() < 2.0 / 65536.0 && limit.abs() < 1e-7, "{name}: {off:?}, {limit:e}");
        }
        let odd: [fn(DVec3) -> f64; 4] = [|w| w.x, |w| w.y, |w| w.x * w.y, |w| w.x.powi(3) * w.z];
        for f in odd {
            let mean = grid_mean(64, map, f);
            assert!(mean.abs() < 1e-13, "odd moment {mean:e}");
        }
    }
}
