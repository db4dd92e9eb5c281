//! The triangles of all meshes in one piece, with what shading needs of them.

use glam::{DVec3, Vec2, Vec3, Vec3A};

use crate::Mesh;
use crate::description::NO_INDEX;
use crate::surface::ShapePoint;

/// Triangles with separate indices for positions, normals and texture coordinates.
#[derive(Debug, Default)]
pub(crate) struct Triangles {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    corners: Vec<[u32; 3]>,
    /// Empty where no mesh has any.
    normal_corners: Vec<[u32; 3]>,
    /// Empty where no mesh has any.
    uv_corners: Vec<[u32; 3]>,
    materials: Vec<u32>,
}

/// Rounding of an interpolated position, as a share of the sum of its terms: pbrt's gamma(7) and as much again, for two
/// corners' positions.
const POSITION_ERROR: f32 = 7.0 * f32::EPSILON;

impl Triangles {
    /// Puts the meshes, whose indices are right, one after the other.
    pub(crate) fn new(meshes: Vec<Mesh>) -> Self {
        let any_normals = meshes.iter().any(|m| !m.normal_indices.is_empty());
        let any_uvs = meshes.iter().any(|m| !m.uv_indices.is_empty());
        let mut all = Self::default();
        for mesh in meshes {
            let count = mesh.triangles.len();
            append_indices(&mut all.corners, &mesh.triangles, all.positions.len());
            if any_normals {
                append_or_fill(&mut all.normal_corners, &mesh.normal_indices, all.normals.len(), count);
            }
            if any_uvs {
                append_or_fill(&mut all.uv_corners, &mesh.uv_indices, all.uvs.len(), count);
            }
            all.positions.extend(mesh.positions);
            all.normals.extend(mesh.normals.iter().map(|n| n.normalize()));
            all.uvs.extend(mesh.uvs);
            all.materials.extend(mesh.materials);
        }
        all
    }

    pub(crate) fn len(&self) -> usize {
        self.corners.len()
    }

    #[inline]
    pub(crate) fn material(&self, triangle: usize) -> u32 {
        self.materials[triangle]
    }

    /// Returns the corners' positions.
    #[inline]
    pub(crate) fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.corners[triangle].map(|i| self.positions[i as usize])
    }

    /// Returns twice the area times the front's unit normal; 0 only where the corners lie exactly on a line.
    pub(crate) fn area_normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        (b - a).cross(c - a)
    }

    /// Returns the texture coordinates at a point; the barycentrics where the triangle has none.
    #[inline]
    pub(crate) fn uv(&self, triangle: usize, barycentrics: Vec2) -> Vec2 {
        match self.uv_corners.get(triangle) {
            Some(indices) if !indices.contains(&NO_INDEX) => {
                let [a, b, c] = indices.map(|i| self.uvs[i as usize]);
                a * (1.0 - barycentrics.x - barycentrics.y) + b * barycentrics.x + c * barycentrics.y
            }
            _ => barycentrics,
        }
    }

    /// Returns the point at barycentric coordinates.
    #[inline]
    pub(crate) fn point(&self, triangle: usize, barycentrics: Vec2) -> ShapePoint {
        let [a, b, c] = self.corners(triangle).map(Vec3A::from);
        let weight = 1.0 - barycentrics.x - barycentrics.y;
        let (pa, pb, pc) = (a * weight, b * barycentrics.x, c * barycentrics.y);
        let normal = (b - a).cross(c - a);
        // Squares of the edges of very small or thin triangles leave the range of f32.
        let ng = normal.try_normalize().unwrap_or_else(|| self.area_normal(triangle).normalize_or(DVec3::Z).as_vec3a());
        let p_error = (pa.abs() + pb.abs() + pc.abs()).dot(ng.abs()) * POSITION_ERROR;
        let n = match self.normal_corners.get(triangle) {
            Some(indices) if !indices.contains(&NO_INDEX) => {
                let [a, b, c] = indices.map(|i| Vec3A::from(self.normals[i as usize]));
                let n = (a * weight + b * barycentrics.x + c * barycentrics.y).try_normalize().unwrap_or(ng);
                if n.dot(ng) < 0.0 { -n } else { n }
            }
            _ => ng,
        };
        ShapePoint { p: pa + pb + pc, ng, n, uv: self.uv(triangle, barycentrics), p_error }
    }

    pub(crate) fn has_shading_normals(&self) -> bool {
        !self.normal_corners.is_empty()
    }

    /// Returns the memory held, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        (self.positions.capacity() + self.normals.capacity()) * size_of::<Vec3>()
            + self.uvs.capacity() * size_of::<Vec2>()
            + (self.corners.capacity() + self.normal_corners.capacity() + self.uv_corners.capacity())
                * size_of::<[u32; 3]>()
            + self.materials.capacity() * size_of::<u32>()
    }
}

fn append_indices(target: &mut Vec<[u32; 3]>, source: &[[u32; 3]], base: usize) {
    let base = u32::try_from(base).expect("the number of vertices was checked");
    let moved = |i: u32| if i == NO_INDEX { NO_INDEX } else { base + i };
    target.extend(source.iter().map(|indices| indices.map(moved)));
}

fn append_or_fill(target: &mut Vec<[u32; 3]>, source: &[[u32; 3]], base: usize, count: usize) {
    if source.is_empty() {
        target.extend(std::iter::repeat_n([NO_INDEX; 3], count));
    } else {
        append_indices(target, source, base);
    }
}
