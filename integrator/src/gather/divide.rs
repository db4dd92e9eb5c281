//! Which texels of a gather are divided, and into how many parts.

use radcache::Samples;

use crate::allocation::neighbours;

/// Most further rays that rims take for each ray of a look, and that glints do; edges are few.
const MOST_RAYS: f32 = 2.0;
/// Most parts along a side of a texel at the rim of the sky.
const RIM_SIDE: u32 = 3;
/// Parts along a side of a texel between bright and dark.
const EDGE_SIDE: u32 = 2;
/// There the texels across differ by more than so many times the mean of the texture, in the root mean square of the
/// directions.
const CONTRAST: f32 = 2.0;
/// What texels with glints may leave to chance: as much as the texels of a look do of which half are lit evenly.
const GLINT_NOISE: f32 = 2.0;
/// Most parts along a side of such a texel.
const MOST_SIDE: f32 = 8.0;
/// The rays that a texel of the mean radiance takes lie in this interval, which is halved so many times.
const GLINT_FACTORS: (f32, f32) = (1e-4, 1e2);
const GLINT_HALVINGS: u32 = 10;

/// Returns into how many parts along a side each texel is divided: where the sky ends, if there is one, and where it
/// gets brighter or darker from one of its neighbours to the one across, along as many of the four directions as there
/// are within the square. By the other texels alone: if its own ray had a say, the mean would be biased. How many others
/// are at the rim it has a say in, but a small one.
pub(super) fn divisions(samples: &Samples, has_sky: bool) -> Vec<u32> {
    let n = samples.resolution();
    let radiance: Vec<f32> = samples.radiance.iter().map(|radiance| radiance.element_sum()).collect();
    // In f64, so that nothing is left of what is taken away again, however bright.
    let total: f64 = radiance.iter().copied().map(f64::from).sum();
    let is_edge = |texel: usize| {
        let across = |step: usize| (radiance[texel + step] - radiance[texel - step]).powi(2);
        let is_inside = |place: usize| place > 0 && place + 1 < n;
        let mean_sq = match (is_inside(texel % n), is_inside(texel / n)) {
            (true, true) => 0.25 * (across(1) + across(n - 1) + across(n) + across(n + 1)),
            (true, false) => across(1),
            (false, true) => across(n),
            (false, false) => 0.0,
        };
        let limit = f64::from(CONTRAST) * (total - f64::from(radiance[texel])) / (n * n - 1) as f64;
        f64::from(mean_sq) > limit * limit
    };
    let is_sky = |texel: usize| samples.distance[texel].is_infinite();
    let is_rim = |texel: usize| {
        let mut others = neighbours(texel, n, n * n).map(is_sky);
        let first = others.next();
        others.any(|sky| Some(sky) != first)
    };
    let rims: Vec<bool> = (0..n * n).map(|texel| has_sky && is_rim(texel)).collect();
    let rim_side = rim_side(rims.iter().filter(|is_rim| **is_rim).count(), n * n);
    let side = |(texel, is_rim): (usize, bool)| match is_rim {
        true if rim_side > 1 => rim_side,
        _ if is_edge(texel) => EDGE_SIDE,
        _ => 1,
    };
    rims.into_iter().enumerate().map(side).collect()
}

/// Into how many parts along a side texels at the rim of the sky are divided, `rims` of so many `texels`: fewer where the
/// sky shows through leaves everywhere.
fn rim_side(rims: usize, texels: usize) -> u32 {
    let rays = |side: &u32| rims as f32 * (side * side - 1) as f32;
    (2..=RIM_SIDE).rev().find(|side| rays(side) <= MOST_RAYS * texels as f32).unwrap_or(1)
}

/// Divides texels that show what is so bright that one ray each would leave much to chance: `sides` are their parts
/// along a side, `brightness` the root mean square of their radiance, relative to the mean of all.
pub(super) fn divide_glints(brightness: &[f32], sides: &mut [u32]) {
    for (side, rays) in sides.iter_mut().zip(ray_shares(brightness)) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most MOST_SIDE")]
        let wanted = rays.sqrt().round() as u32;
        *side = (*side).max(wanted);
    }
}

/// Returns how many rays each texel should take: in proportion to the brightness (Neyman 1934), until what they leave to
/// chance is little enough, but no more than so many.
fn ray_shares(brightness: &[f32]) -> impl Iterator<Item = f32> {
    let count = brightness.len() as f32;
    // The relative variance by a ray a texel and these, times the number of texels.
    let rays = |factor: f32, b: f32| (factor * b).clamp(1.0, MOST_SIDE * MOST_SIDE);
    let noise = |factor: f32| brightness.iter().map(|&b| b * b / rays(factor, b)).sum::<f32>() / count;
    let cost = |factor: f32| brightness.iter().map(|&b| rays(factor, b) - 1.0).sum::<f32>() / count;
    let mut range = GLINT_FACTORS;
    for _ in 0..GLINT_HALVINGS {
        let middle = (range.0 * range.1).sqrt();
        let is_enough = noise(middle) <= GLINT_NOISE || cost(middle) >= MOST_RAYS;
        if is_enough { range.1 = middle } else { range.0 = middle }
    }
    brightness.iter().map(move |&b| rays(range.0, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec3, Vec3A};

    const N: usize = 8;

    fn even() -> Samples {
        let mut samples = Samples::new(N);
        for texel in 0..N * N {
            samples.set(texel, Vec3::ONE, 1.0, Vec3A::NEG_Z);
        }
        samples
    }

    #[test]
    fn texels_between_bright_and_dark_are_divided_by_others_than_themselves() {
        let mut samples = even();
        assert!(divisions(&samples, false).iter().all(|&side| side == 1), "all alike");
        let bright = 2 * N + 3;
        samples.radiance[bright] = Vec3::splat(50.0);
        let sides = divisions(&samples, false);
        assert_eq!(sides[bright], 1, "its neighbours are alike");
        for beside in [bright - 1, bright + 1, bright - N, bright + N + 1] {
            assert_eq!(sides[beside], EDGE_SIDE, "texel {beside}");
        }
        assert_eq!(sides.iter().filter(|side| **side > 1).count(), 8);
        // However bright a texel is, that does not change whether it is divided: neither one that is by a little nor
        // one that is not.
        samples.radiance[bright] = Vec3::splat(8.0);
        let sides = divisions(&samples, false);
        for texel in [bright + 1, bright + 2] {
            for radiance in [0.0, 1e3, 1e6, 1e9] {
                let mut changed = samples.clone();
                changed.radiance[texel] = Vec3::splat(radiance);
                assert_eq!(divisions(&changed, false)[texel], sides[texel], "texel {texel} of {radiance}");
            }
        }
    }

    #[test]
    fn rims_are_those_of_a_sky() {
        let mut samples = even();
        samples.distance[0] = f32::INFINITY;
        assert!(divisions(&samples, false).iter().all(|&side| side == 1), "black void has no rim");
        let sides = divisions(&samples, true);
        assert_eq!([sides[0], sides[1], sides[N + 1], sides[2]], [1, RIM_SIDE, RIM_SIDE, 1]);
    }

    #[test]
    fn rims_everywhere_are_divided_less() {
        let side_of_rims = |is_sky: fn(usize, usize) -> bool| {
            let mut samples = even();
            for texel in (0..N * N).filter(|texel| is_sky(texel % N, texel / N)) {
                samples.distance[texel] = f32::INFINITY;
            }
            divisions(&samples, true).into_iter().max().unwrap()
        };
        assert_eq!(side_of_rims(|x, y| x < 2 && y < 2), 3, "eight texels");
        assert_eq!(side_of_rims(|_, y| y < 4), 3, "two rows");
        assert_eq!(side_of_rims(|_, y| y == 4), 2, "three rows");
        assert_eq!(side_of_rims(|x, y| (x + y) % 2 == 0), 1, "all of them");
    }
}
