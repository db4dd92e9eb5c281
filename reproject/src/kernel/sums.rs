//! Weights of the elements, and the sums of radiance by them.

use radcache::{Elements, LANES};

use super::board::{Places, Task};
use crate::AreaWeights;

/// Sums radiance by shares in 16 lanes, element e in lane e mod 16, and adds the lanes in order: the same for every
/// kernel.
#[inline(always)]
pub(super) fn sum(task: &Task<'_>, places: &Places) -> [f32; 7] {
    let Elements { radiance, background_share, .. } = task.elements;
    let [red, green, blue] = radiance.each_ref().map(|channel| channel.as_chunks::<LANES>().0);
    let shares = background_share.as_chunks::<LANES>().0;
    let counts = places.counts.as_chunks::<LANES>().0;
    let areas = places.area.as_chunks::<LANES>().0;
    let texels = (task.n * task.n) as f32;
    let by_area = task.settings.weights == AreaWeights::Analytic;
    let mut sums = [[0.0f32; LANES]; 7];
    for chunk in 0..shares.len() {
        let (counts, area) = (&counts[chunk], &areas[chunk]);
        let (share, red, green, blue) = (&shares[chunk], &red[chunk], &green[chunk], &blue[chunk]);
        for lane in 0..LANES {
            let [covered, taken] = counts[lane].map(f32::from);
            let weight = weight(taken, covered, area[lane], texels, by_area);
            let far = weight * share[lane];
            let near = weight - far;
            sums[0][lane] += weight;
            sums[1][lane] += near * red[lane];
            sums[2][lane] += near * green[lane];
            sums[3][lane] += near * blue[lane];
            sums[4][lane] += far * red[lane];
            sums[5][lane] += far * green[lane];
            sums[6][lane] += far * blue[lane];
        }
    }
    sums.map(|lanes| lanes.into_iter().sum::<f32>())
}

/// The share in the integral of an element that takes so many of the texels that it covers.
#[inline(always)]
fn weight(taken: f32, covered: f32, area: f32, texels: f32, by_area: bool) -> f32 {
    let visible = if taken == covered { area } else { area * taken / covered };
    let share = if by_area { visible } else { taken / texels };
    if taken == 0.0 { 0.0 } else { share }
}
