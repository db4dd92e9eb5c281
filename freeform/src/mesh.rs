//! Meshes of solids, for programs that know nothing else.
//!
//! Space is cut into cubes and each cube into six tetrahedra that meet along its diagonal, the same way in all cubes.
//! Corners are inside or not; each edge between an inside and an outside corner has one vertex, where the ray along the
//! edge crosses the surface, and each tetrahedron one or two triangles. Whatever the corners say, that is a closed
//! manifold. What is thinner than a cell may fall between the corners.
//!
//! # Source
//! Doi and Koide 1991: An efficient method of triangulating equi-valued surfaces by using tetrahedral cells. Kuhn 1960
//! for the six tetrahedra.

use std::collections::HashMap;
use std::io::{self, Write};

use glam::{DAffine3, DVec2, DVec3};

use crate::{Bounds, Interval, Ray, Solid};

/// A closed surface of triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Points on the surface.
    pub positions: Vec<DVec3>,
    /// Outward unit normal at each position.
    pub normals: Vec<DVec3>,
    /// Three indices into both a triangle; counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates, (u, v) with v upwards in the picture; none from [`Solid::to_mesh`].
    pub uvs: Vec<DVec2>,
    /// Three indices into them for each triangle, if there are any.
    pub uv_triangles: Vec<[u32; 3]>,
}

/// Says why a solid has no mesh.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The solid may reach to infinity.
    #[error("the form has no bounds; clip it")]
    Unbounded,
    /// The cell is not a length.
    #[error("the cell must be positive and finite; give a length")]
    Cell,
    /// More cells, cells in a layer across z, or vertices than can be held.
    #[error("a grid of {0:e} cells; take a larger cell")]
    TooFine(f64),
}

/// Cells of a grid; beyond, a mesh takes hours.
const CELLS_MAX: f64 = 1e10;
/// Corners of a layer; two of them take 2 GB. Cells alone do not limit them: a flat solid has few layers.
const LAYER_MAX: f64 = (1 << 25) as f64;
/// A vertex stays this share of its edge away from the corners, so that no triangle loses its area to rounding.
const CLEARANCE: f64 = 1e-6;
/// Marks an edge that has no vertex yet.
const NONE: u32 = u32::MAX;
/// Directions of edges from their lower corner: bits for x, y and z.
const DIRECTIONS: usize = 7;
/// The corners of the six tetrahedra of a cube, as bits for x, y and z: each is a way from corner 0 to corner 7 along
/// the axes.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

impl Solid {
    /// Returns a mesh of cubes with sides of `cell`: a closed manifold whose vertices are on the surface.
    ///
    /// Triangles are about `cell^2 / (8 r)` from a surface of radius of curvature r.
    ///
    /// # Errors
    /// The solid has no bounds, the cell is not a length, or there are too many cells.
    pub fn to_mesh(&self, cell: f64) -> Result<SurfaceMesh, MeshError> {
        if !(cell > 0.0 && cell.is_finite()) {
            return Err(MeshError::Cell);
        }
        let Bounds::Finite { min, max } = self.bounds() else { return Err(MeshError::Unbounded) };
        // A cell more on each side: the outermost corners are outside.
        let sides = ((max - min) / cell).ceil() + DVec3::splat(2.0);
        let cells = sides.x * sides.y * sides.z;
        let layer = (sides.x + 1.0) * (sides.y + 1.0);
        if cells.is_nan() || cells > CELLS_MAX || layer > LAYER_MAX {
            return Err(MeshError::TooFine(cells));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by CELLS_MAX")]
        let counts = sides.to_array().map(|side| side as usize + 1);
        let origin = 0.5 * (min + max) - 0.5 * cell * sides;
        let mut grid = Grid { solid: self, cell, origin, counts, mesh: SurfaceMesh::default(), row: Vec::new() };
        let mut lower = grid.layer(0);
        for k in 1..counts[2] {
            let mut upper = grid.layer(k);
            grid.add_slab(k - 1, &mut lower, &mut upper);
            lower = upper;
            if grid.mesh.positions.len() >= NONE as usize - 8 * counts[0] * counts[1] {
                return Err(MeshError::TooFine(cells));
            }
        }
        Ok(grid.mesh)
    }
}

impl SurfaceMesh {
    /// Returns the mesh moved by a transformation that is not singular: the mesh of a copy of the solid. Outside stays
    /// outside.
    #[must_use]
    pub fn transformed(&self, transform: &DAffine3) -> Self {
        let normal_matrix = transform.matrix3.inverse().transpose();
        let (mut triangles, mut uv_triangles) = (self.triangles.clone(), self.uv_triangles.clone());
        if transform.matrix3.determinant() < 0.0 {
            triangles.iter_mut().chain(&mut uv_triangles).for_each(|triangle| triangle.swap(1, 2));
        }
        Self {
            positions: self.positions.iter().map(|&p| transform.transform_point3(p)).collect(),
            normals: self.normals.iter().map(|&n| (normal_matrix * n).normalize_or_zero()).collect(),
            triangles,
            uvs: self.uvs.clone(),
            uv_triangles,
        }
    }

    /// Returns the mesh with texture coordinates: `uv` gives those of a point on a triangle with an outward normal.
    ///
    /// Where u is an angle over a whole turn, it `runs_round`: a triangle across the seam goes on beyond 0 or 1, as
    /// pictures do that are repeated.
    ///
    /// # Panics
    /// If there are more than 2^32 of them.
    #[must_use]
    pub fn with_texture_coordinates(mut self, runs_round: bool, uv: impl Fn(DVec3, DVec3) -> DVec2) -> Self {
        self.uvs.clear();
        self.uv_triangles.clear();
        // Corners that meet share theirs, but for those on a seam.
        let mut numbers = HashMap::new();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|corner| self.positions[corner as usize]);
            let normal = (b - a).cross(c - a).normalize_or(self.normals[triangle[0] as usize]);
            let mut uvs = [a, b, c].map(|p| uv(p, normal));
            if runs_round {
                let first = uvs[0].x;
                uvs.iter_mut().for_each(|uv| uv.x -= (uv.x - first).round());
            }
            let number = |corner: usize| {
                let uv = uvs[corner];
                *numbers.entry((triangle[corner], uv.to_array().map(f64::to_bits))).or_insert_with(|| {
                    self.uvs.push(uv);
                    u32::try_from(self.uvs.len() - 1).expect("fewer than 2^32")
                })
            };
            self.uv_triangles.push([0, 1, 2].map(number));
        }
        self
    }

    /// Writes the mesh as an object of an OBJ file in which so many vertices, and so many texture coordinates, stand
    /// before it.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_obj(&self, name: &str, before: [usize; 2], out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "o {name}")?;
        for p in &self.positions {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for n in &self.normals {
            writeln!(out, "vn {:.6} {:.6} {:.6}", n.x, n.y, n.z)?;
        }
        for uv in &self.uvs {
            writeln!(out, "vt {:.6} {:.6}", uv.x, uv.y)?;
        }
        for (index, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|corner| corner as usize + before[0] + 1);
            match self.uv_triangles.get(index) {
                Some(uvs) => {
                    let [ta, tb, tc] = uvs.map(|uv| uv as usize + before[1] + 1);
                    writeln!(out, "f {a}/{ta}/{a} {b}/{tb}/{b} {c}/{tc}/{c}")?;
                }
                None => writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?,
            }
        }
        Ok(())
    }
}

/// The corners of one layer in z.
struct Layer {
    inside: Vec<bool>,
    /// The vertex of each edge that begins at a corner of the layer.
    vertices: Vec<[u32; DIRECTIONS]>,
}

struct Grid<'a> {
    solid: &'a Solid,
    cell: f64,
    origin: DVec3,
    /// Corners along each axis.
    counts: [usize; 3],
    mesh: SurfaceMesh,
    row: Vec<Interval>,
}

impl Grid<'_> {
    fn corner(&self, i: usize, j: usize, k: usize) -> DVec3 {
        self.origin + self.cell * DVec3::new(i as f64, j as f64, k as f64)
    }

    /// Returns the sides of the corners of a layer, by one ray for each row.
    fn layer(&mut self, k: usize) -> Layer {
        let [nx, ny, nz] = self.counts;
        let mut inside = vec![false; nx * ny];
        let inner = |i: usize, n: usize| i > 0 && i + 1 < n;
        for j in (0..ny).filter(|&j| inner(j, ny) && inner(k, nz)) {
            let ray = Ray::new(self.corner(0, j, k), DVec3::X * self.cell);
            self.solid.intervals(&ray, &mut self.row);
            for &Interval { t_in, t_out } in &self.row {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the row")]
                let (first, last) = (t_in.ceil().max(1.0) as usize, t_out.floor().min((nx - 2) as f64) as usize);
                (first..=last).for_each(|i| inside[j * nx + i] = true);
            }
        }
        Layer { inside, vertices: vec![[NONE; DIRECTIONS]; nx * ny] }
    }

    fn add_slab(&mut self, k: usize, lower: &mut Layer, upper: &mut Layer) {
        let [nx, ny, _] = self.counts;
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                let at = |bits: usize| (j + (bits >> 1 & 1)) * nx + i + (bits & 1);
                let inside: [bool; 8] =
                    std::array::from_fn(
                        |bits| if bits & 4 == 0 { lower.inside[at(bits)] } else { upper.inside[at(bits)] },
                    );
                if inside.iter().all(|side| *side == inside[0]) {
                    continue;
                }
                for corners in TETRAHEDRA {
                    self.add_tetrahedron([i, j, k], corners, &inside, |grid, a, b| {
                        let layer = if a & 4 == 0 { &mut *lower } else { &mut *upper };
                        let slot = &mut layer.vertices[at(a)][(a ^ b) - 1];
                        if *slot == NONE {
                            *slot = grid.add_vertex([i, j, k], a, b, inside[a]);
                        }
                        *slot
                    });
                }
            }
        }
    }

    /// Adds the triangles of a tetrahedron; `vertex` gives the vertex of the edge from corner a up to corner b.
    fn add_tetrahedron(
        &mut self,
        cube: [usize; 3],
        corners: [usize; 4],
        inside: &[bool; 8],
        mut vertex: impl FnMut(&mut Self, usize, usize) -> u32,
    ) {
        let mut within = [0; 4];
        let mut count = 0;
        let mut without = [0; 4];
        let mut rest = 0;
        for corner in corners {
            if inside[corner] {
                within[count] = corner;
                count += 1;
            } else {
                without[rest] = corner;
                rest += 1;
            }
        }
        if count == 0 || rest == 0 {
            return;
        }
        let (within, without) = (&within[..count], &without[..rest]);
        // Edges in the order of a triangle, or around a quadrilateral.
        let (a, b) = (|k: usize| within[k % count], |k: usize| without[k % rest]);
        let edges: [(usize, usize); 4] = match count {
            2 => [(a(0), b(0)), (a(0), b(1)), (a(1), b(1)), (a(1), b(0))],
            _ => [(a(0), b(0)), (a(1), b(1)), (a(2), b(2)), (a(0), b(0))],
        };
        let place = |corner: usize| {
            let [i, j, k] = cube;
            self.corner(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2))
        };
        // The turn is taken from the middles of the edges, which never coincide.
        let middle = edges.map(|(from, to)| 0.5 * (place(from) + place(to)));
        let centre = |corners: &[usize]| corners.iter().map(|c| place(*c)).sum::<DVec3>() / corners.len() as f64;
        let outwards = centre(without) - centre(within);
        let is_front = (middle[1] - middle[0]).cross(middle[2] - middle[0]).dot(outwards) > 0.0;
        let v = edges.map(|(from, to)| vertex(self, from.min(to), from.max(to)));
        let mut add = |x: u32, y: u32, z: u32| self.mesh.triangles.push(if is_front { [x, y, z] } else { [x, z, y] });
        add(v[0], v[1], v[2]);
        if count == 2 {
            add(v[0], v[2], v[3]);
        }
    }

    /// Adds the vertex between two corners on different sides.
    fn add_vertex(&mut self, [i, j, k]: [usize; 3], a: usize, b: usize, a_inside: bool) -> u32 {
        let corner = |bits: usize| self.corner(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2));
        let (from, to) = (corner(a), corner(b));
        let ray = Ray::new(from, to - from).between(0.0, 1.0);
        let hit = self.solid.first_hit(&ray).filter(|hit| hit.entering != a_inside);
        // Where rounding hides the crossing it is at the corner that is nearer to the surface.
        let t = hit.map_or_else(
            || if self.solid.value(from).abs() < self.solid.value(to).abs() { 0.0 } else { 1.0 },
            |hit| hit.t,
        );
        let p = ray.at(t.clamp(CLEARANCE, 1.0 - CLEARANCE));
        let n = match hit {
            Some(hit) => self.solid.normal_at(hit.part, p, ray.direction),
            None => self.solid.normal(p, ray.direction),
        };
        self.mesh.positions.push(p);
        self.mesh.normals.push(n);
        // The caller counts vertices after each layer.
        u32::try_from(self.mesh.positions.len() - 1).unwrap_or(NONE - 1)
    }
}
