//! The system of the links between cells.

use glam::Vec3;
use rayon::prelude::*;

use super::guide::LinkEnd;
use crate::statistics::RayCounts;

/// Estimated error of the iteration at its end, relative to the sum over the cells.
const PRECISION: f64 = 1e-5;
const MAX_ITERATIONS: usize = 500;
/// After so many steps, when the changes have become geometric, the rest of their series is added at once.
const EXTRAPOLATION: usize = 8;

/// Irradiance of a cell, W m^-2.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CellLight {
    /// Straight from the sources.
    pub(super) direct: Vec3,
    /// By reflections, caustics included.
    pub(super) indirect: Vec3,
    /// The part of that which came by caustics.
    pub(super) caustic: Vec3,
}

/// A cell's sources and links.
#[derive(Default)]
pub(super) struct Row {
    /// Light of lamps, by light samples.
    pub(super) lamps: Vec3,
    /// Other light straight from its sources, as rays met it.
    pub(super) direct: Vec3,
    /// Light of walks that met no cell.
    pub(super) source: Vec3,
    pub(super) caustic: Vec3,
    pub(super) links: Vec<(u32, Vec3)>,
    /// What the rays of the links met.
    pub(super) ends: Vec<LinkEnd>,
    pub(super) rays: RayCounts,
}

impl Row {
    /// A dark one, for so many rays.
    pub(super) fn with_capacity(ray_count: usize) -> Self {
        Self { links: Vec::with_capacity(ray_count), ends: Vec::with_capacity(ray_count), ..Self::default() }
    }

    /// Multiplies what links brought: where each stands for its own share, these must sum to 1, or the light of a white
    /// room would grow without end.
    pub(super) fn scale_links(&mut self, factor: f32) {
        self.direct *= factor;
        self.source *= factor;
        for (_, weight) in &mut self.links {
            *weight *= factor;
        }
        for end in &mut self.ends {
            end.share *= factor;
            end.source *= factor;
        }
    }

    /// All light straight from its sources.
    fn all_direct(&self) -> Vec3 {
        self.direct + self.lamps
    }
}

/// Iterates E = D + W E from the sources up. The changes soon become geometric, and their ratio tells what is still to
/// come, unless light goes to and fro between two sides: there, what is added at once takes the iteration away from its
/// end, and so is given up as soon as it has not helped.
pub(super) fn solve(rows: &[Row]) -> Vec<CellLight> {
    let mut indirect: Vec<Vec3> = vec![Vec3::ZERO; rows.len()];
    let mut last_change = f64::INFINITY;
    // At the last extrapolation; none is made where this is 0.
    let mut extrapolated_change = f64::INFINITY;
    for step in 1..=MAX_ITERATIONS {
        let mut next: Vec<Vec3> = rows
            .par_iter()
            .map(|row| {
                let all = |cell: u32| rows[cell as usize].all_direct() + indirect[cell as usize];
                row.source + row.caustic + row.links.iter().map(|&(cell, weight)| weight * all(cell)).sum::<Vec3>()
            })
            .collect();
        let sum = |values: &mut dyn Iterator<Item = Vec3>| values.map(|v| f64::from(v.element_sum())).sum::<f64>();
        let change = sum(&mut next.iter().zip(&indirect).map(|(a, b)| (*a - *b).abs()));
        let ratio = (change / last_change).min(0.9999);
        let rest = ratio / (1.0 - ratio);
        last_change = change;
        if step % EXTRAPOLATION == 0 {
            extrapolated_change = if change < 0.5 * extrapolated_change { change } else { 0.0 };
        }
        if step % EXTRAPOLATION == 0 && extrapolated_change > 0.0 {
            #[expect(clippy::cast_possible_truncation, reason = "below 10^4")]
            let rest = rest as f32;
            for (new, old) in next.iter_mut().zip(&indirect) {
                *new = (*new + (*new - *old) * rest).max(Vec3::ZERO);
            }
            last_change = f64::INFINITY;
        }
        indirect = next;
        if change * rest <= PRECISION * sum(&mut indirect.iter().copied()) && step % EXTRAPOLATION != 1 {
            break;
        }
    }
    let light = |(row, indirect): (&Row, Vec3)| CellLight { direct: row.all_direct(), indirect, caustic: row.caustic };
    rows.iter().zip(indirect).map(light).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solved(rows: Vec<(f32, Vec<(u32, f32)>)>) -> Vec<f32> {
        let rows: Vec<Row> = rows
            .into_iter()
            .map(|(direct, links)| Row {
                direct: Vec3::splat(direct),
                links: links.into_iter().map(|(cell, weight)| (cell, Vec3::splat(weight))).collect(),
                ..Row::default()
            })
            .collect();
        solve(&rows).iter().map(|light| (light.indirect + light.direct).x).collect()
    }

    #[test]
    fn light_between_two_sides_is_solved() {
        // Two walls that see each other alone, one of them lit: E0 = 1 + w E1, E1 = w E0. The eigenvalues are w and -w.
        for w in [0.3, 0.8, 0.95_f32] {
            let lit = 1.0 / (1.0 - w * w);
            let found = solved(vec![(1.0, vec![(1, w)]), (0.0, vec![(0, w)])]);
            assert!((found[0] / lit - 1.0).abs() < 1e-3 && (found[1] / (w * lit) - 1.0).abs() < 1e-3, "{w}: {found:?}");
        }
    }

    #[test]
    fn light_in_a_white_room_is_solved() {
        // Eight cells that see each other evenly: E = D + w mean(E).
        for w in [0.5, 0.98_f32] {
            let links: Vec<(u32, f32)> = (0..8).map(|cell| (cell, w / 8.0)).collect();
            let rows = (0..8).map(|cell| (cell as f32, links.clone())).collect();
            let mean = 3.5 / (1.0 - w);
            for (cell, found) in solved(rows).into_iter().enumerate() {
                let expected = cell as f32 + w * mean;
                assert!((found / expected - 1.0).abs() < 1e-3, "{w}: {found} is not {expected}");
            }
        }
    }
}
