//! Rays that a reprojection asks for: holes without bias, and verification that finds what a record cannot know.

mod rooms;

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{MergeSettings, Record, RecordSettings, Samples, Validity};
use reproject::{AreaWeights, Settings, Workspace};
use rooms::{Rays, Scene, Seen, Shape, record_in, uniform};

const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };

/// Radiance 1 where wi.x > 0.3, from infinity.
fn step(_: Vec3A, wi: Vec3A) -> Seen {
    (Vec3::splat(if wi.x > 0.3 { 1.0 } else { 0.0 }), f32::INFINITY, -wi)
}

/// Its mean: (acos 0.3 - 0.3 sqrt 0.91) / pi.
const EXPECTED: f64 = 0.311919;

/// A record of the step of which `known` texels are right and the others must be traced.
fn partly_known(n: usize, known: impl Fn(usize) -> bool) -> Record {
    let mut samples = Samples::from_fn(n, |wi| step(Vec3A::ZERO, wi));
    const SUB: usize = 64;
    for texel in 0..n * n {
        let cell = Vec2::new((texel % n) as f32, (texel / n) as f32);
        let bright = (0..SUB * SUB).filter(|k| {
            let place = Vec2::new((k % SUB) as f32 + 0.5, (k / SUB) as f32 + 0.5) / SUB as f32;
            hemimap::square_to_cosine_hemisphere((cell + place) / n as f32).x > 0.3
        });
        samples.radiance[texel] = Vec3::splat(bright.count() as f32 / (SUB * SUB) as f32);
        samples.view_dependent[texel] = !known(texel);
    }
    let merge = MergeSettings { max_side: 1, ..MergeSettings::default() };
    Record::new(
        Vec3A::ZERO,
        FRAME,
        samples,
        &RecordSettings { merge, ..RecordSettings::default() },
        &Validity::default(),
    )
}

#[test]
#[expect(clippy::print_stdout, reason = "the bias of a fixed ray is a figure to report, with --nocapture")]
fn hole_rays_are_unbiased() {
    for n in [1usize, 7, 16, 33] {
        for k in [1, 2, 3, 8, u32::try_from(n + 1).unwrap()] {
            for half in [false, true] {
                let record = partly_known(n, |texel| half && uniform(texel as u64) < 0.5);
                let mut workspace = Workspace::new();
                let weights = AreaWeights::Bits;
                workspace.project(&record, Vec3A::ZERO, Vec3A::Z, &Settings { weights, ..Settings::default() });
                let mut seeds = Vec::new();
                for seed in 0..32u64 {
                    // So many runs that the standard error is below 0.5 % of the answer.
                    let (mut sum, mut rays, mut runs) = (0.0f64, 0, 0u64);
                    while rays < 4500 {
                        let made = workspace.trace_holes(k, seed << 32 | runs, &mut Rays(Vec3A::ZERO, step));
                        sum += f64::from(workspace.mean_radiance().x);
                        (rays, runs) = (rays + made.max(1), runs + 1);
                    }
                    seeds.push(sum / runs as f64);
                }
                let mean = seeds.iter().sum::<f64>() / 32.0;
                let deviation = (seeds.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 31.0).sqrt();
                let error = deviation / 32f64.sqrt();
                assert!(error <= 0.005 * EXPECTED, "n = {n}, k = {k}: the test says nothing at {error}");
                // The known half is right to 1 / 64 of the texels that the edge of light crosses.
                let slack = 4.5 * error + 1e-3 / n as f64;
                assert!((mean - EXPECTED).abs() <= slack, "n = {n}, k = {k}, half {half}: {mean} +- {error}");
            }
        }
    }
    let (n, k) = (32, 8);
    let fixed = (0..(n / k) * (n / k)).filter(|block| {
        let place = Vec2::new((block % (n / k)) as f32 + 0.5, (block / (n / k)) as f32 + 0.5) * k as f32 / n as f32;
        hemimap::square_to_cosine_hemisphere(place).x > 0.3
    });
    let fixed = fixed.count() as f64 / 16.0;
    println!("a fixed ray in the centre of each 8 x 8 block of 32 x 32: {fixed}, off by {:.4}", fixed - EXPECTED);
    assert!((fixed - EXPECTED).abs() > 0.01, "a fixed ray is biased");
}

/// Weights of a block are its unfilled texels: clipped at the border where k does not divide n, they make one together.
#[test]
fn hole_weights_make_one() {
    let bright = |_, wi: Vec3A| (Vec3::ONE, 1.0, -wi);
    for n in [1, 7, 16, 33, 64] {
        for k in [1, 2, 3, 8, n + 1] {
            let record = partly_known(n, |_| false);
            let mut workspace = Workspace::new();
            workspace.project(&record, Vec3A::ZERO, Vec3A::Z, &Settings::default());
            let k = u32::try_from(k).unwrap();
            let rays = workspace.trace_holes(k, 3, &mut Rays(Vec3A::ZERO, bright));
            assert_eq!(rays, n.div_ceil((k as usize).min(n)).pow(2), "one ray a block");
            assert!((workspace.mean_radiance().x - 1.0).abs() < 1e-5, "n = {n}, k = {k}");
            let weights = vec![Vec3::splat(1.0 / (n * n) as f32); n * n];
            assert!((workspace.weighted_sum(&record, &weights).x - 1.0).abs() < 1e-5, "n = {n}, k = {k}");
            assert!(workspace.texture(&record).iter().all(|&l| l == Vec3::ONE), "every texel has its block's ray");
        }
    }
    // Step 0 counts as 1.
    let record = partly_known(7, |_| false);
    let mut workspace = Workspace::new();
    workspace.project(&record, Vec3A::ZERO, Vec3A::Z, &Settings::default());
    assert_eq!(workspace.trace_holes(0, 3, &mut Rays(Vec3A::ZERO, bright)), 49);
}

/// A lobe of half of the hemisphere asks for no rays through the other half, and gets the same light.
#[test]
fn holes_without_weight_are_not_traced() {
    let n = 32;
    let record = partly_known(n, |texel| uniform(texel as u64) < 0.5);
    let weights: Vec<Vec3> = (0..n * n).map(|texel| Vec3::splat(f32::from(texel % n < n / 2))).collect();
    let mut workspace = Workspace::new();
    workspace.project(&record, Vec3A::ZERO, Vec3A::Z, &Settings::default());
    let all = workspace.trace_holes(2, 5, &mut Rays(Vec3A::ZERO, step));
    let sum = workspace.weighted_sum(&record, &weights);
    let under = workspace.trace_holes_under(&weights, 2, 5, &mut Rays(Vec3A::ZERO, step));
    assert_eq!(workspace.weighted_sum(&record, &weights), sum, "the same rays where they count");
    assert!(under > 0 && under * 3 < all * 2, "{under} of {all} rays");
}

/// The weighted sum is that of the texture.
#[test]
fn weighted_sum_is_the_sum_over_the_texture() {
    let scene = Scene::cornell();
    let look = |p, wi| scene.look(p, wi);
    let from = Vec3A::new(0.6, 0.55, -0.999);
    let record = record_in(look, from, FRAME, 32, &RecordSettings::default());
    let p = from + Vec3A::new(-0.05, 0.03, 0.0);
    let mut workspace = Workspace::new();
    workspace.project(&record, p, Vec3A::Z, &Settings::default());
    workspace.trace_holes(2, 7, &mut Rays(p, look));
    let weights: Vec<Vec3> = (0..32 * 32u64).map(|k| Vec3::new(uniform(k), uniform(k + 5000), 0.0)).collect();
    let expected: Vec3 = workspace.texture(&record).iter().zip(&weights).map(|(&l, &w)| l * w).sum();
    let found = workspace.weighted_sum(&record, &weights);
    assert!((found - expected).abs().max_element() < 1e-4 * expected.x, "{found} for {expected}");
}

/// A gap that no record outside can see into: there verification finds nearly everything wrong, elsewhere nearly
/// nothing.
#[test]
fn verification_refuses_a_record_that_cannot_know() {
    // A floor under the sky, and a slab over its right half, 2 cm above it.
    let mut scene = Scene { sky: Vec3::ONE, ..Scene::default() };
    scene.shapes.push((Shape::Rectangle(Vec3A::new(5.0, 0.0, 0.02), Vec3A::X * 5.0, Vec3A::Y * 5.0), Vec3::ZERO));
    let look = |p, wi| scene.look(p, wi);
    let from = Vec3A::new(-0.1, 0.0, 0.0);
    let record = record_in(look, from, FRAME, 32, &RecordSettings::default());
    let mut workspace = Workspace::new();
    let mut ask = |p: Vec3A, side: u32| {
        workspace.project(&record, p, Vec3A::Z, &Settings::default());
        let verdict = workspace.verify(&record, side, 11, &mut Rays(p, look));
        (verdict, workspace.masks().count(&workspace.masks().fill))
    };
    let (own, _) = ask(from, 8);
    assert!(own.asked == 64 && own.wrong <= 3, "the record knows its own place: {own:?}");
    let (beside, _) = ask(from + Vec3A::Y * 0.05, 8);
    assert!(beside.asked >= 60 && beside.wrong <= 4, "and the place beside it: {beside:?}");
    let (inside, filled) = ask(Vec3A::new(0.1, 0.0, 0.0), 8);
    assert!(filled > 512 && inside.wrong * 5 > inside.asked * 3, "but not what is inside the gap: {inside:?}");
    let (none, _) = ask(from, 0);
    assert_eq!((none.asked, none.wrong), (0, 0), "no ray, no verdict");
    let (many, _) = ask(from, 1000);
    assert!(many.asked <= 256, "at most 16 x 16");
    // Between verification and hole rays nothing of it is left.
    workspace.project(&record, from, Vec3A::Z, &Settings::default());
    let before = workspace.mean_radiance();
    workspace.verify(&record, 4, 2, &mut Rays(from, look));
    assert_eq!(workspace.mean_radiance(), before, "verification rays bring no light");
}
