//! Materials against their closed forms.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, Vec3A};
use scene::{Bsdf, Lobes, Specular, fresnel_dielectric};

fn ggx(alpha: f32) -> Bsdf {
    Bsdf { diffuse: Vec3::ZERO, specular: Specular::Ggx { alpha, reflectance: Vec3::ONE, schlick: false } }
}

fn plastic(schlick: bool) -> Bsdf {
    let reflectance = Vec3::new(0.04, 0.2, 0.5);
    Bsdf { diffuse: Vec3::ONE - reflectance, specular: Specular::Ggx { alpha: 0.3, reflectance, schlick } }
}

fn incidence(cosine: f32) -> Vec3A {
    Vec3A::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
}

/// Point `i` of `count` of a Hammersley set.
fn hammersley(i: u32, count: u32) -> Vec2 {
    Vec2::new((i as f32 + 0.5) / count as f32, (i.reverse_bits() >> 8) as f32 / 16_777_216.0)
}

/// Returns which of `count` cells of [0, 1] holds x.
#[expect(clippy::cast_possible_truncation, reason = "rounds down to an index")]
fn cell(x: f32, count: usize) -> usize {
    ((x * count as f32) as usize).min(count - 1)
}

/// The mean weight of samples: the share of the light that leaves `wo` reflected.
fn albedo(bsdf: &Bsdf, wo: Vec3A, count: u32) -> Vec3 {
    let mut random = 1u32;
    let weight = |i| {
        random = random.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let u_lobe = (random >> 8) as f32 / 16_777_216.0;
        bsdf.sample(Lobes::ALL, wo, u_lobe, hammersley(i, count)).map_or(Vec3::ZERO, |s| s.weight)
    };
    (0..count).map(weight).fold(glam::DVec3::ZERO, |sum, w| sum + w.as_dvec3()).as_vec3() / count as f32
}

#[test]
fn ggx_single_scatter_energy_is_in_the_table() {
    // Energy at the cosines 1, 0.5, 0.1, computed by independent sampling; 1 - ln 2 at alpha = 1, cosine 1 is exact.
    let table = [
        (0.001, [1.0, 1.0, 0.9999]),
        (0.1, [0.9883, 0.9691, 0.8728]),
        (0.2, [0.9477, 0.8941, 0.8628]),
        (0.25, [0.9158, 0.8551, 0.8543]),
        (0.5, [0.6878, 0.6860, 0.7723]),
        (0.75, [0.4639, 0.5374, 0.6645]),
        (1.0, [0.3069, 0.4091, 0.5579]),
    ];
    for (alpha, energies) in table {
        for (cosine, energy) in [1.0, 0.5, 0.1].into_iter().zip(energies) {
            let found = albedo(&ggx(alpha), incidence(cosine), 1 << 16).x;
            assert!((found - energy).abs() < 1e-3, "alpha {alpha}, cosine {cosine}: {found} is not {energy}");
        }
    }
}

#[test]
fn ggx_eval_integrates_to_the_energy_of_its_samples() {
    // Quadrature of f cos over the hemisphere, which shares nothing with sampling.
    for (alpha, cosine, energy) in [(0.5, 0.5, 0.6860), (1.0, 0.1, 0.5579), (0.25, 1.0, 0.9158)] {
        let (bsdf, wo, n) = (ggx(alpha), incidence(cosine), 400);
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                // Uniform in solid angle: 2 pi a cell.
                let (z, phi) = ((i as f32 + 0.5) / n as f32, TAU * (j as f32 + 0.5) / n as f32);
                let r = (1.0 - z * z).sqrt();
                sum += f64::from(bsdf.eval(Lobes::ALL, wo, Vec3A::new(r * phi.cos(), r * phi.sin(), z)).x * z);
            }
        }
        let found = sum * f64::from(TAU) / f64::from(n * n);
        assert!((found - energy).abs() < 2e-3, "alpha {alpha}, cosine {cosine}: {found} is not {energy}");
    }
}

#[test]
fn eval_and_pdf_in_one_are_the_same_as_apart() {
    let mirror = Bsdf { diffuse: Vec3::splat(0.2), specular: Specular::Mirror { reflectance: Vec3::ONE } };
    let clear =
        Bsdf { diffuse: Vec3::ZERO, specular: Specular::Ggx { alpha: 0.3, reflectance: Vec3::ZERO, schlick: true } };
    for bsdf in [ggx(0.1), ggx(0.7), plastic(false), plastic(true), clear, mirror, Bsdf::BLACK] {
        for lobes in [Lobes::DIFFUSE, Lobes::SPECULAR, Lobes::ALL] {
            for i in 0..1000 {
                let wo = hemimap::square_to_uniform_hemisphere(hammersley(i, 1000));
                let wi = hemimap::square_to_uniform_hemisphere(hammersley(i.wrapping_mul(79) % 1000, 1000));
                for wi in [wi, -wi] {
                    let apart = (bsdf.eval(lobes, wo, wi), bsdf.pdf(lobes, wo, wi));
                    assert_eq!(bsdf.eval_pdf(lobes, wo, wi), apart, "{bsdf:?}, {lobes:?}: {wo}, {wi}");
                }
            }
        }
    }
}

#[test]
fn bsdf_is_reciprocal() {
    for bsdf in [ggx(0.1), ggx(0.7), plastic(false), plastic(true)] {
        for i in 0..20_000 {
            let w = hemimap::square_to_uniform_hemisphere(hammersley(i, 20_000));
            let v = hemimap::square_to_uniform_hemisphere(hammersley(i.wrapping_mul(7919) % 20_000, 20_000));
            let (there, back) = (bsdf.eval(Lobes::ALL, w, v), bsdf.eval(Lobes::ALL, v, w));
            assert!((there - back).abs().cmple(there * 1e-5).all(), "{bsdf:?}: {there} is not {back}");
        }
    }
}

#[test]
fn no_material_reflects_more_than_it_receives() {
    for bsdf in [plastic(false), plastic(true), ggx(0.01), Bsdf { diffuse: Vec3::ONE, specular: Specular::None }] {
        for cosine in [1.0, 0.7, 0.3, 0.1, 0.02, 1e-3] {
            let found = albedo(&bsdf, incidence(cosine), 1 << 15);
            assert!(found.max_element() <= 1.0 + 1e-2, "{bsdf:?}, cosine {cosine}: {found}");
        }
    }
}

#[test]
fn samples_follow_their_pdf() {
    // Cells of equal solid angle; the expected counts by quadrature of the pdf in each.
    const ROWS: usize = 16;
    const COLUMNS: usize = 24;
    const SAMPLES: u32 = 200_000;
    for bsdf in [ggx(0.3), ggx(1.0), plastic(true), Bsdf { diffuse: Vec3::ONE, specular: Specular::None }] {
        for degrees in [0.0f32, 30.0, 60.0, 80.0, 89.0] {
            let wo = incidence(degrees.to_radians().cos());
            let mut counts = vec![0u32; ROWS * COLUMNS];
            for i in 0..SAMPLES {
                let u_lobe = (i.wrapping_mul(2_654_435_769) >> 8) as f32 / 16_777_216.0;
                let random = i.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
                let mixed = (random ^ (random >> 15)).wrapping_mul(0x2c1b_3c6d);
                let u = Vec2::new((mixed >> 8) as f32 / 16_777_216.0, (i as f32 + 0.5) / SAMPLES as f32);
                let Some(sample) = bsdf.sample(Lobes::ALL, wo, u_lobe, u) else { continue };
                let row = cell(sample.wi.z, ROWS);
                let turn = (sample.wi.y.atan2(sample.wi.x) / TAU).rem_euclid(1.0);
                counts[row * COLUMNS + cell(turn, COLUMNS)] += 1;
                assert_eq!(
                    sample.pdf,
                    bsdf.pdf(Lobes::ALL, wo, sample.wi),
                    "the sample's pdf is that of its direction"
                );
            }
            let (mut statistic, mut cells) = (0.0, 0);
            for (cell, &count) in counts.iter().enumerate() {
                let (row, column) = (cell / COLUMNS, cell % COLUMNS);
                let (n, mut sum) = (24, 0.0);
                for i in 0..n * n {
                    let z = (row as f32 + ((i / n) as f32 + 0.5) / n as f32) / ROWS as f32;
                    let phi = TAU * (column as f32 + ((i % n) as f32 + 0.5) / n as f32) / COLUMNS as f32;
                    let r = (1.0 - z * z).sqrt();
                    sum += f64::from(bsdf.pdf(Lobes::ALL, wo, Vec3A::new(r * phi.cos(), r * phi.sin(), z)));
                }
                let expected =
                    sum * f64::from(TAU) / f64::from((n * n) as u32) / (ROWS * COLUMNS) as f64 * f64::from(SAMPLES);
                if expected > 20.0 {
                    statistic += (f64::from(count) - expected).powi(2) / expected;
                    cells += 1;
                }
            }
            // Mean and deviation of chi-squared: k and sqrt(2 k); 5 deviations, for one number of each sample is
            // stratified and the quadrature rounds.
            let limit = f64::from(cells) + 5.0 * (2.0 * f64::from(cells)).sqrt();
            assert!(cells > 5 && statistic < limit, "{bsdf:?}, {degrees} degrees: {statistic} of {cells} cells");
        }
    }
}

#[test]
fn fresnel_of_dielectric_has_its_known_values() {
    let near = |a: f32, b: f32| (a - b).abs() < 2e-6;
    for (eta, normal, brewster, at_brewster, outside, inside) in [
        (1.5f32, 0.04, 56.309_93f32, 0.073_964_497, 0.091_777_96, 0.596_345_76),
        (1.8, 0.081_632_653, 60.945_396, 0.139_551_44, 0.134_054_45, 0.732_732_85),
    ] {
        assert!(near(fresnel_dielectric(1.0, eta), normal), "{eta}: at right angles");
        assert!(near(fresnel_dielectric(1.0, 1.0 / eta), normal), "{eta}: at right angles from inside");
        assert!(near(fresnel_dielectric(brewster.to_radians().cos(), eta), at_brewster), "{eta}: at Brewster's angle");
        assert_eq!(fresnel_dielectric(0.0, eta), 1.0, "{eta}: grazing");
        let critical = (1.0 / eta).asin();
        assert_eq!(fresnel_dielectric((critical + 1e-3).cos(), 1.0 / eta), 1.0, "{eta}: beyond the critical angle");
        assert!(fresnel_dielectric((critical - 1e-2).cos(), 1.0 / eta) < 0.9, "{eta}: before the critical angle");
        // Hemispherical mean: 2 c dc, by the midpoint rule, which meets a square root's kink.
        let n = 100_000;
        let mean = |eta| {
            (0..n)
                .map(|i| (i as f32 + 0.5) / n as f32)
                .map(|c| f64::from(2.0 * c * fresnel_dielectric(c, eta)))
                .sum::<f64>()
                / f64::from(n)
        };
        assert!((mean(eta) - outside).abs() < 1e-5, "{eta}: mean from outside {}", mean(eta));
        assert!((mean(1.0 / eta) - inside).abs() < 1e-5, "{eta}: mean from inside {}", mean(1.0 / eta));
    }
}

#[test]
fn refraction_obeys_snell_and_keeps_radiance_over_index_squared() {
    let glass = Bsdf { diffuse: Vec3::ZERO, specular: Specular::Dielectric { eta: 1.5, tint: Vec3::ONE } };
    for degrees in [0.0f32, 1e-3, 20.0, 60.0, 89.0] {
        let wo = incidence(degrees.to_radians().cos());
        let [Some(reflected), Some(refracted)] = glass.delta_branches(wo) else {
            panic!("both below the critical angle")
        };
        assert!(
            (refracted.wi.x + wo.x / 1.5).abs() < 1e-6 && refracted.wi.z < 0.0,
            "{degrees} degrees: {}",
            refracted.wi
        );
        let total = reflected.weight + refracted.weight / refracted.radiance_scale;
        assert!((total - 1.0).abs().max_element() < 1e-6, "{degrees} degrees: flux is kept: {total}");
        assert!((refracted.radiance_scale - 1.0 / 2.25).abs() < 1e-6, "radiance grows where it enters");
        // Sampled: the branch weights come back.
        let share = reflected.weight.x;
        let low = glass.sample(Lobes::ALL, wo, 0.5 * share, Vec2::ZERO).expect("reflection");
        let high = glass.sample(Lobes::ALL, wo, 0.5 + 0.5 * share, Vec2::ZERO).expect("refraction");
        assert!(!low.transmitted && high.transmitted && low.delta && high.delta, "u_lobe chooses the branch");
        assert!((high.weight - 1.0 / 2.25).abs().max_element() < 1e-5, "{degrees} degrees: {}", high.weight);
    }
    let inside = Bsdf { diffuse: Vec3::ZERO, specular: Specular::Dielectric { eta: 1.0 / 1.5, tint: Vec3::ONE } };
    assert!(inside.delta_branches(incidence(0.3))[1].is_none(), "total reflection");
}

#[test]
fn delta_lobes_are_seen_by_sampling_alone() {
    let mirror = Bsdf { diffuse: Vec3::splat(0.2), specular: Specular::Mirror { reflectance: Vec3::splat(0.6) } };
    let wo = incidence(0.5);
    let wi = Vec3A::new(-wo.x, 0.0, wo.z);
    assert_eq!(mirror.eval(Lobes::SPECULAR, wo, wi), Vec3::ZERO, "f of a delta lobe");
    assert_eq!(mirror.pdf(Lobes::SPECULAR, wo, wi), 0.0, "pdf of a delta lobe");
    assert!((albedo(&mirror, wo, 1 << 16) - 0.8).abs().max_element() < 5e-3, "both parts are sampled");
    assert!(!mirror.is_delta() && mirror.has_diffuse(), "it has a diffuse part");
    assert!(mirror.sample(Lobes::ALL, -wo, 0.5, Vec2::ZERO).is_none(), "nothing from behind");
    assert_eq!(mirror.eval(Lobes::ALL, wo, -wi), Vec3::ZERO, "nothing to behind");
}

#[test]
fn what_is_never_sampled_has_no_density() {
    let (wo, wi, u) = (incidence(0.8), incidence(0.3), Vec2::new(0.3, 0.7));
    let dull = Specular::Ggx { alpha: 0.3, reflectance: Vec3::ZERO, schlick: false };
    let chalk = Bsdf { diffuse: Vec3::splat(0.8), specular: Specular::None };
    let dark = Bsdf { diffuse: Vec3::ZERO, specular: dull };
    for (bsdf, lobes, what) in [
        (Bsdf::BLACK, Lobes::ALL, "black"),
        (chalk, Lobes::SPECULAR, "chalk without its diffuse part"),
        (dark, Lobes::ALL, "gloss that reflects nothing"),
        (Bsdf { diffuse: Vec3::ONE, ..dark }, Lobes::SPECULAR, "gloss of nothing over white"),
    ] {
        assert_eq!(bsdf.sample(lobes, wo, 0.5, u), None, "{what} gives no direction");
        assert_eq!(bsdf.pdf(lobes, wo, wi), 0.0, "{what}");
        assert_eq!(bsdf.eval_pdf(lobes, wo, wi), (Vec3::ZERO, 0.0), "{what}, both at once");
    }
}
