//! Polygons into triangles: the fan where it is right, ear cutting (earcutr) where it is not.

use glam::{DVec2, DVec3, Vec3};

use super::error::{LoadError, Place};
use super::limits;

/// Cuts polygons within the limits.
#[derive(Debug, Default)]
pub(super) struct Cutter {
    /// Sum of the squared corners of all polygons whose ears were cut.
    squares: usize,
}

impl Cutter {
    /// Appends the triangles of a polygon as indices into its corners, in the polygon's own sense of rotation.
    ///
    /// A quad is split by the diagonal that lies inside it, the first one where both do. Corners of other polygons are
    /// seen along their mean (Newell) normal. Returns whether anything was appended: not for fewer than three corners,
    /// nor for a polygon of which no ear can be cut.
    pub(super) fn cut(
        &mut self,
        corners: &[Vec3],
        triangles: &mut Vec<[u32; 3]>,
        place: Place<'_>,
    ) -> Result<bool, LoadError> {
        let before = triangles.len();
        match corners {
            [] | [_] | [_, _] => {}
            [_, _, _] => triangles.push([0, 1, 2]),
            &[a, b, c, d] => {
                let normal = |p: Vec3, q: Vec3, r: Vec3| (q - p).as_dvec3().cross((r - p).as_dvec3());
                let first_is_outside = normal(a, b, c).dot(normal(a, c, d)) < 0.0;
                let second_is_inside = normal(b, c, d).dot(normal(b, d, a)) > 0.0;
                triangles.extend(if first_is_outside && second_is_inside {
                    [[1, 2, 3], [1, 3, 0]]
                } else {
                    [[0, 1, 2], [0, 2, 3]]
                });
            }
            _ if corners.len() > limits::CORNERS => {
                let what =
                    format!("a polygon of {} corners, more than the limit of {}", corners.len(), limits::CORNERS);
                return Err(place.too_large(what, "split it"));
            }
            _ => {
                let flat = flatten(corners);
                if fan_is_right(&flat, rounding(corners)) {
                    triangles.extend((2..index(flat.len())).map(|i| [0, i - 1, i]));
                } else {
                    self.count(flat.len(), place)?;
                    cut_ears(&flat, triangles);
                }
            }
        }
        Ok(triangles.len() > before)
    }

    /// Refuses what would take ear cutting too long.
    fn count(&mut self, corners: usize, place: Place<'_>) -> Result<(), LoadError> {
        self.squares += corners * corners;
        if corners > limits::CONCAVE_CORNERS {
            let limit = limits::CONCAVE_CORNERS;
            let what = format!("a concave polygon of {corners} corners, more than the limit of {limit}");
            return Err(place.too_large(what, "split it"));
        }
        if self.squares > limits::CONCAVE_SQUARES {
            return Err(place.too_large("too many large concave polygons", "split them into triangles"));
        }
        Ok(())
    }
}

/// Corners seen against the polygon's normal, so that the polygon runs counter-clockwise.
fn flatten(corners: &[Vec3]) -> Vec<DVec2> {
    let origin = corners[0].as_dvec3();
    let relative: Vec<DVec3> = corners.iter().map(|p| p.as_dvec3() - origin).collect();
    let next = relative.iter().cycle().skip(1);
    let normal: DVec3 = relative.iter().zip(next).map(|(p, q)| p.cross(*q)).sum();
    let axis = normal.abs();
    let flat = |p: &DVec3| {
        if axis.x >= axis.y && axis.x >= axis.z {
            DVec2::new(p.y * normal.x.signum(), p.z)
        } else if axis.y >= axis.z {
            DVec2::new(p.z * normal.y.signum(), p.x)
        } else {
            DVec2::new(p.x * normal.z.signum(), p.y)
        }
    };
    relative.iter().map(flat).collect()
}

/// How far single precision may have moved a coordinate.
fn rounding(corners: &[Vec3]) -> f64 {
    f64::from(corners.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max)) * f64::from(f32::EPSILON)
}

/// Whether no triangle between the first corner and an edge turns the wrong way by more than rounding can make it.
fn fan_is_right(flat: &[DVec2], rounding: f64) -> bool {
    flat.windows(2).all(|edge| {
        let (a, b) = (edge[0] - flat[0], edge[1] - flat[0]);
        a.perp_dot(b) >= -rounding * (a.length() + b.length())
    })
}

fn cut_ears(flat: &[DVec2], triangles: &mut Vec<[u32; 3]>) {
    let coordinates: Vec<f64> = flat.iter().flat_map(|p| [p.x, p.y]).collect();
    let indices = earcutr::earcut(&coordinates, &[], 2).unwrap_or_default();
    for triple in indices.chunks_exact(3) {
        let [a, b, c] = [triple[0], triple[1], triple[2]];
        // The library's own sense of rotation depends on its version.
        let turned = (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]) < 0.0;
        triangles.push(if turned { [index(a), index(c), index(b)] } else { [index(a), index(b), index(c)] });
    }
}

fn index(i: usize) -> u32 {
    u32::try_from(i).expect("a polygon has at most limits::CORNERS corners")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn triangulate(corners: &[Vec3], triangles: &mut Vec<[u32; 3]>) -> bool {
        Cutter::default().cut(corners, triangles, Place::file(Path::new("x"))).expect("it is within the limits")
    }

    fn area(corners: &[Vec3]) -> f64 {
        let mut triangles = Vec::new();
        assert!(triangulate(corners, &mut triangles), "{corners:?} has triangles");
        let corner = |i: u32| corners[i as usize].as_dvec3();
        let normal = |[a, b, c]: &[u32; 3]| (corner(*b) - corner(*a)).cross(corner(*c) - corner(*a)) / 2.0;
        let sum: DVec3 = triangles.iter().map(normal).sum();
        let total: f64 = triangles.iter().map(|t| normal(t).length()).sum();
        assert!((sum.length() - total).abs() <= 1e-9 * total, "all triangles of {corners:?} turn alike");
        total
    }

    fn polygon(points: &[[f32; 2]]) -> Vec<Vec3> {
        points.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect()
    }

    #[test]
    fn area_is_kept() {
        let shapes: [(&[[f32; 2]], f64); 4] = [
            (&[[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]], 4.0),
            (&[[1.0, 1.0], [0.0, 4.0], [0.0, 0.0], [4.0, 0.0]], 4.0),
            (&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]], 10.0),
            (&[[0.0, 0.0], [2.0, 0.0], [3.0, 1.0], [1.0, 3.0], [-1.0, 2.0], [-1.0, 1.0]], 8.0),
        ];
        for (points, expected) in shapes {
            for turn in 0..points.len() {
                let mut corners = polygon(points);
                corners.rotate_left(turn);
                assert!((area(&corners) - expected).abs() < 1e-6, "{points:?} turned by {turn}");
                // The same polygon seen from other sides.
                let other: Vec<Vec3> = corners.iter().rev().map(|p| Vec3::new(p.y, 7.0, p.x)).collect();
                assert!((area(&other) - expected).abs() < 1e-6, "{points:?} in the plane y = 7");
            }
        }
    }

    #[test]
    fn every_corner_of_a_comb_is_used_once_as_an_ear() {
        let teeth = 200;
        let mut points: Vec<[f32; 2]> = (0..teeth).map(|i| [i as f32, (i % 2) as f32]).collect();
        points.push([teeth as f32, 5.0]);
        points.push([-1.0, 5.0]);
        let corners = polygon(&points);
        let mut triangles = Vec::new();
        assert!(triangulate(&corners, &mut triangles), "a comb is simple");
        assert_eq!(triangles.len(), corners.len() - 2, "n - 2 triangles");
        let shoelace: f64 =
            corners.iter().zip(corners.iter().cycle().skip(1)).map(|(p, q)| f64::from(p.x * q.y - q.x * p.y)).sum();
        assert!((area(&corners) - shoelace / 2.0).abs() < 1e-3, "area of the comb");
    }

    #[test]
    fn hostile_polygons_are_refused_in_the_end() {
        let corners: Vec<Vec3> =
            (0..4096).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).chain([Vec3::Y * 9.0]).collect();
        let mut cutter = Cutter::default();
        let mut cut = |corners: &[Vec3]| cutter.cut(corners, &mut Vec::new(), Place::file(Path::new("x")));
        assert!(matches!(cut(&corners), Err(LoadError::TooLarge(_))), "4097 corners");
        assert!((0..14).all(|_| cut(&corners[1..]).is_ok()), "4096 corners, a few times");
        assert!(matches!(cut(&corners[1..]), Err(LoadError::TooLarge(_))), "and once too often");
    }

    #[test]
    fn needles_and_points_do_no_harm() {
        let mut triangles = Vec::new();
        triangulate(&[Vec3::ONE; 7], &mut triangles);
        assert!(triangles.iter().flatten().all(|&i| i < 7), "indices stay inside");
        assert!(!triangulate(&[Vec3::ONE; 2], &mut triangles), "two corners make no triangle");
    }
}
