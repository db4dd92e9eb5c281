//! proto
use std::iter::zip;

use glam::{Mat3, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use rayon::prelude::*;
use scene::{Scene, Surface};

use super::Cells;
use super::probe::{FoundCell, SIGHT_HEIGHT, sight};
use super::solve::{CellLight, Row};
use crate::sky::luminance;

fn envf(name: &str, default: f32) -> f32 {
    std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(default)
}

struct Centre {
    surface: Surface,
    variance: f32,
}

pub(super) fn smooth(scene: &Scene, cells: &Cells, found: &[FoundCell], rows: &[Row], light: &mut [CellLight]) -> u64 {
    let radius = envf("SM_R", 2.0) as i32;
    let vf = envf("SM_V", 1.0);
    let ridge = envf("SM_RIDGE", 0.02);
    let clampk = envf("SM_K", 1.0);
    if radius == 0 {
        return 0;
    }
    let now = std::time::Instant::now();
    let centres: Vec<Centre> = found
        .par_iter()
        .zip(rows)
        .map(|(cell, row)| {
            let inv = 1.0 / cell.points.len() as f32;
            let p = cell.points.iter().map(|s| s.p).sum::<Vec3A>() * inv;
            let ng = cell.points.iter().map(|s| s.ng).sum::<Vec3A>().normalize_or(Vec3A::Y);
            let surface = Surface { p, ng, n: ng, ..cell.points[0] };
            // Variance of the sum over rays.
            let x = |end: &super::guide::LinkEnd| {
                end.source
                    + row.links[end.links.start as usize..end.links.end as usize]
                        .iter()
                        .map(|&(c, w)| {
                            let l = &light[c as usize];
                            luminance(w * (l.direct + l.indirect))
                        })
                        .sum::<f32>()
            };
            let n = row.ends.len() as f32;
            let (s, sq) = row.ends.iter().map(x).fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
            let variance = if n > 1.0 { (sq - s * s / n).max(0.0) * n / (n - 1.0) } else { f32::INFINITY };
            Centre { surface, variance }
        })
        .collect();
    let lifted = |i: usize| centres[i].surface.p + SIGHT_HEIGHT * found[i].width * centres[i].surface.ng;
    let smooth_part = |l: &CellLight, row: &Row| (row.direct, l.indirect - l.caustic);
    let results: Vec<(Option<([Vec3; 2], f32, usize)>, u64)> = (0..found.len())
        .into_par_iter()
        .map(|i| {
            let width = found[i].width;
            let Surface { p, ng, .. } = centres[i].surface;
            let frame = Frame::from_normal(ng);
            let mut near: Vec<u32> = Vec::new();
            for y in -radius..=radius {
                for x in -radius..=radius {
                    let q = p + width * (x as f32 * frame.s + y as f32 * frame.t);
                    if let Some(j) = cells.cell_of(&Surface { p: q, ..centres[i].surface })
                        && !near.contains(&j)
                    {
                        near.push(j);
                    }
                }
            }
            let me = i as u32;
            let mut rays = 0;
            near.retain(|&j| {
                j == me || {
                    rays += 1;
                    centres[j as usize].surface.ng.dot(ng) > 0.95
                        && !scene.occluded(&sight(lifted(i), lifted(j as usize)))
                }
            });
            if !near.contains(&me) || near.len() < 4 {
                return (None, rays);
            }
            let at = |j: u32| {
                let d = frame.to_local(centres[j as usize].surface.p - p) / width;
                Vec2::new(d.x, d.y)
            };
            let reach = radius as f32 + 1.0;
            let weight = |j: u32| {
                let d = at(j).length() / reach;
                rows[j as usize].ends.len() as f32 * (1.0 - d * d).max(0.05)
            };
            let mut m = Mat3::ZERO;
            let mut total = 0.0;
            for &j in &near {
                let x = Vec3::new(1.0, at(j).x, at(j).y);
                let w = weight(j);
                total += w;
                m.x_axis += w * x.x * x;
                m.y_axis += w * x.y * x;
                m.z_axis += w * x.z * x;
            }
            m.y_axis.y += ridge * total;
            m.z_axis.z += ridge * total;
            let inv = m.inverse();
            let mut fit = [[Vec3::ZERO; 2]; 3];
            for &j in &near {
                let x = inv * (weight(j) * Vec3::new(1.0, at(j).x, at(j).y));
                let (a, b) = smooth_part(&light[j as usize], &rows[j as usize]);
                for k in 0..3 {
                    fit[k][0] += x[k] * a;
                    fit[k][1] += x[k] * b;
                }
            }
            let mut resid = 0.0;
            let mut noise = 0.0;
            for &j in &near {
                let d = at(j);
                let w = weight(j) / total;
                let (a, b) = smooth_part(&light[j as usize], &rows[j as usize]);
                let r = [a, b];
                let e: Vec3 = (0..2).map(|c| r[c] - (fit[0][c] + d.x * fit[1][c] + d.y * fit[2][c])).sum();
                resid += w * luminance(e).powi(2);
                noise += w * centres[j as usize].variance;
            }
            resid *= near.len() as f32 / (near.len() as f32 - 3.0);
            let k = if resid > 0.0 { (vf * noise / resid).min(1.0) } else { 1.0 } * clampk;
            let (a, b) = smooth_part(&light[i], &rows[i]);
            let new = [a + k * (fit[0][0] - a), b + k * (fit[0][1] - b)].map(|v| v.max(Vec3::ZERO));
            (Some((new, k, near.len())), rays)
        })
        .collect();
    let rays = results.iter().map(|r| r.1).sum();
    let (mut ks, mut ns, mut c) = (0.0, 0, 0);
    for ((result, _), (light, row)) in zip(results, zip(light, rows)) {
        let Some(([direct, indirect], k, n)) = result else { continue };
        ks += k;
        ns += n;
        c += 1;
        light.direct = row.lamps + direct;
        light.indirect = light.caustic + indirect;
    }
    if std::env::var("SM_P").is_ok() {
        eprintln!("smooth {} cells, {c} smoothed, mean k {}, near {}, {:.4} s, links {}", found.len(), ks / c as f32, ns as f32 / c as f32, now.elapsed().as_secs_f32(), rows.iter().map(|r| r.ends.len()).sum::<usize>());
    }
    rays
}
