//! Meshes of bodies.

use std::collections::HashMap;

use glam::Vec3;

/// Positions, and three indices into them for each triangle; counter-clockwise is the outside.
type Triangles = (Vec<Vec3>, Vec<[u32; 3]>);

/// Returns a sphere about `centre` of 20 x 4^`level` triangles whose *surface* is that of a ball of `radius`.
///
/// The mean area of its shadow is then right too (Cauchy: a quarter of the surface), which is what counts for a lamp.
///
/// # Panics
/// If `level` is so large that vertices cannot be numbered.
#[must_use]
pub fn icosphere(centre: Vec3, radius: f32, level: u32) -> Triangles {
    let (mut positions, mut triangles) = icosahedron();
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push((positions[i as usize] + positions[j as usize]).normalize());
                    u32::try_from(positions.len() - 1).expect("a coarse sphere")
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let area: f64 = triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|i| positions[i as usize].as_dvec3());
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let scale = f64::from(radius) * (4.0 * std::f64::consts::PI / area).sqrt();
    let positions = positions.iter().map(|p| centre + (p.as_dvec3() * scale).as_vec3()).collect();
    (positions, triangles)
}

fn icosahedron() -> Triangles {
    let g = 0.5 * (1.0 + 5f32.sqrt());
    let corners = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ];
    #[rustfmt::skip]
    let triangles = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    (corners.map(|(x, y, z)| Vec3::new(x, y, z).normalize()).to_vec(), triangles)
}

/// Returns the box between two corners.
#[must_use]
pub fn cuboid(min: Vec3, max: Vec3) -> Triangles {
    let corner = |i: u32| {
        let pick = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
        Vec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z))
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sixth of the sum of a . (b x c): positive where all fronts look outwards.
    fn volume((positions, triangles): &Triangles) -> f64 {
        let corners = triangles.iter().map(|t| t.map(|i| positions[i as usize].as_dvec3()));
        corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn fronts_look_outwards() {
        assert!((volume(&cuboid(Vec3::NEG_ONE, Vec3::new(1.0, 2.0, 3.0))) - 24.0).abs() < 1e-12, "2 x 3 x 4");
        let ball = volume(&icosphere(Vec3::ZERO, 1.0, 3));
        // A body of the surface of a ball has less volume, here by about the square of the edges, 0.13.
        assert!((4.15..4.189).contains(&ball), "{ball} instead of 4 pi / 3");
    }
}
