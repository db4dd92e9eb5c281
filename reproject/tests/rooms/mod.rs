//! Small analytic scenes of rectangles, discs and spheres, with a ray caster of its own: the oracle of tests and
//! benches.

#![allow(dead_code, unreachable_pub, reason = "each test takes what it needs, and the benches all of it")]

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{DepthRange, MergeSettings, Record, RecordSettings, Samples, Validity};
use reproject::{AreaWeights, Coverage, Settings, Shares, Traced, Tracer, Trails, Workspace};

/// What a ray sees: radiance, distance (infinite for the surroundings) and normal, all in world space.
pub type Seen = (Vec3, f32, Vec3A);

/// A flat piece or a sphere, seen from both sides.
#[derive(Debug, Clone, Copy)]
pub enum Shape {
    /// Centre and half edges.
    Rectangle(Vec3A, Vec3A, Vec3A),
    /// Centre, normal and radius.
    Disc(Vec3A, Vec3A, f32),
    /// Centre and radius.
    Sphere(Vec3A, f32),
}

/// Shapes with their radiance, before a sky.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    pub shapes: Vec<(Shape, Vec3)>,
    pub sky: Vec3,
}

impl Shape {
    /// Distance and normal of the nearest hit beyond `MIN`.
    fn hit(&self, p: Vec3A, wi: Vec3A) -> Option<(f32, Vec3A)> {
        const MIN: f32 = 1e-4;
        let (t, normal) = match *self {
            Self::Rectangle(centre, s, t) => {
                let normal = s.cross(t).normalize();
                let distance = normal.dot(centre - p) / normal.dot(wi);
                let q = p + wi * distance - centre;
                let inside = q.dot(s).abs() <= s.length_squared() && q.dot(t).abs() <= t.length_squared();
                (if inside { distance } else { -1.0 }, normal)
            }
            Self::Disc(centre, normal, radius) => {
                let distance = normal.dot(centre - p) / normal.dot(wi);
                let q = p + wi * distance - centre;
                (if q.length() <= radius { distance } else { -1.0 }, normal)
            }
            Self::Sphere(centre, radius) => {
                let q = p - centre;
                let half_b = q.dot(wi);
                let root = (half_b * half_b - q.length_squared() + radius * radius).sqrt();
                let near = -half_b - root;
                let t = if near > MIN { near } else { -half_b + root };
                (t, (q + wi * t) / radius)
            }
        };
        (t > MIN && t.is_finite()).then_some((t, if normal.dot(wi) > 0.0 { -normal } else { normal }))
    }
}

impl Scene {
    /// The nearest hit along a ray.
    pub fn look(&self, p: Vec3A, wi: Vec3A) -> Seen {
        let mut seen = (self.sky, f32::INFINITY, -wi);
        for (shape, radiance) in &self.shapes {
            if let Some((t, normal)) = shape.hit(p, wi)
                && t < seen.1
            {
                seen = (*radiance, t, normal);
            }
        }
        seen
    }

    /// Adds the six faces of a box turned by `turn` radians about z, each face a little different.
    pub fn add_box(&mut self, centre: Vec3A, half: Vec3A, turn: f32, radiance: Vec3) {
        let (sin, cos) = turn.sin_cos();
        let axes = [Vec3A::new(cos, sin, 0.0) * half.x, Vec3A::new(-sin, cos, 0.0) * half.y, Vec3A::Z * half.z];
        for k in 0..3 {
            for side in [-1.0, 1.0] {
                let face = Shape::Rectangle(centre + axes[k] * side, axes[(k + 1) % 3], axes[(k + 2) % 3]);
                self.shapes.push((face, radiance * (1.0 + 0.15 * k as f32 + 0.05 * side)));
            }
        }
    }

    /// The room of the Cornell box, 2 x 2 x 2 around the origin, with two blocks and a lamp that is a patch of its
    /// ceiling.
    pub fn cornell() -> Self {
        let mut scene = Self::default();
        scene.add_box(Vec3A::ZERO, Vec3A::ONE, 0.0, Vec3::new(0.5, 0.4, 0.3));
        scene.add_box(Vec3A::new(0.35, -0.35, -0.7), Vec3A::splat(0.3), -0.3, Vec3::new(0.3, 0.4, 0.2));
        scene.add_box(Vec3A::new(-0.35, 0.3, -0.4), Vec3A::new(0.3, 0.3, 0.6), 0.3, Vec3::new(0.2, 0.3, 0.4));
        let lamp = Shape::Rectangle(Vec3A::new(0.0, 0.0, 0.995), Vec3A::X * 0.3, Vec3A::Y * 0.3);
        scene.shapes.push((lamp, Vec3::splat(5.0)));
        scene
    }

    /// The same room with `count` small boxes at random.
    pub fn clutter(count: u64) -> Self {
        let mut scene = Self::default();
        scene.add_box(Vec3A::ZERO, Vec3A::ONE, 0.0, Vec3::new(0.5, 0.4, 0.3));
        for k in 0..count {
            let u = |m| uniform(8 * k + m);
            let centre = Vec3A::new(u(0), u(1), u(2)) * 1.8 - 0.9;
            let half = Vec3A::new(u(3), u(4), u(5)) * 0.06 + 0.02;
            scene.add_box(centre, half, 3.0 * u(6), Vec3::splat(0.2 + u(7)));
        }
        scene
    }

    /// The same room with twelve spheres.
    pub fn spheres() -> Self {
        let mut scene = Self::default();
        scene.add_box(Vec3A::ZERO, Vec3A::ONE, 0.0, Vec3::new(0.5, 0.4, 0.3));
        for k in 0..12u64 {
            let u = |m| uniform(1000 + 8 * k + m);
            let sphere = Shape::Sphere(Vec3A::new(u(0), u(1), u(2)) * 1.4 - 0.7, 0.08 + 0.17 * u(3));
            scene.shapes.push((sphere, Vec3::new(u(4), u(5), u(6))));
        }
        scene
    }

    /// A yard under the sky: ground at z = -1, three walls, columns, a round roof.
    pub fn yard() -> Self {
        let mut scene = Self { sky: Vec3::new(0.8, 0.9, 1.2), ..Self::default() };
        let ground = Shape::Rectangle(Vec3A::new(0.0, 0.0, -1.0), Vec3A::X * 20.0, Vec3A::Y * 20.0);
        scene.shapes.push((ground, Vec3::splat(0.3)));
        scene.add_box(Vec3A::new(-3.0, 0.0, 0.0), Vec3A::new(0.2, 3.0, 1.0), 0.0, Vec3::new(0.4, 0.2, 0.2));
        scene.add_box(Vec3A::new(0.0, 3.0, 0.0), Vec3A::new(3.0, 0.2, 1.0), 0.0, Vec3::new(0.4, 0.4, 0.2));
        scene.add_box(Vec3A::new(3.0, 0.0, 0.0), Vec3A::new(0.2, 3.0, 1.0), 0.1, Vec3::new(0.2, 0.4, 0.4));
        for k in 0..8 {
            let (sin, cos) = (0.8 * k as f32).sin_cos();
            scene.add_box(
                Vec3A::new(1.6 * cos, 1.6 * sin, -0.2),
                Vec3A::new(0.12, 0.12, 0.8),
                k as f32,
                Vec3::splat(0.5),
            );
        }
        let roof = Shape::Disc(Vec3A::new(0.0, 0.0, 0.6), Vec3A::Z, 1.8);
        scene.shapes.push((roof, Vec3::new(0.1, 0.1, 0.15)));
        scene
    }
}

/// Number `k` of a sequence in [0, 1) that looks random (Steele, Lea, Flood 2014).
pub fn uniform(k: u64) -> f32 {
    let mut x = k.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ x >> 31) >> 40) as f32 / 16_777_216.0
}

/// A record of n x n texels at `p` in `frame` of what `look` tells.
pub fn record_in(
    look: impl Fn(Vec3A, Vec3A) -> Seen,
    p: Vec3A,
    frame: Frame,
    n: usize,
    settings: &RecordSettings,
) -> Record {
    let samples = Samples::from_fn(n, |wi| {
        let (radiance, distance, normal) = look(p, frame.to_world(wi));
        (radiance, distance, frame.to_local(normal))
    });
    Record::new(p, frame, samples, settings, &Validity::default())
}

/// The same in the frame of `Frame::from_normal`.
pub fn record(
    look: impl Fn(Vec3A, Vec3A) -> Seen,
    p: Vec3A,
    normal: Vec3A,
    n: usize,
    settings: &RecordSettings,
) -> Record {
    record_in(look, p, Frame::from_normal(normal), n, settings)
}

/// Number `kind` of the kinds of records: as a renderer makes them; in large elements, of which many are tall or cut by
/// the horizon; as the paper does; and one of which every third texel holds for its own place only.
pub fn every_kind_of_record(scene: &Scene, from: Vec3A, n: usize, kind: u64) -> Record {
    let usual = MergeSettings::default();
    let settings = match kind % 4 {
        0 | 3 => RecordSettings::default(),
        1 => RecordSettings {
            layers: 1,
            merge: MergeSettings { max_side: 64, depth: DepthRange::Parallax(10.0), ..usual },
        },
        _ => RecordSettings { layers: 32, merge: MergeSettings { depth: DepthRange::Layer, ..usual } },
    };
    let frame = Frame::from_normal(Vec3A::Z);
    let mut samples = Samples::from_fn(n, |wi| {
        let (radiance, distance, normal) = scene.look(from, frame.to_world(wi));
        (radiance, distance, frame.to_local(normal))
    });
    if kind % 4 == 3 {
        samples.view_dependent.iter_mut().step_by(3).for_each(|depends| *depends = true);
    }
    Record::new(from, frame, samples, &settings, &Validity::default())
}

/// Each combination of the settings that choose how a record is reprojected.
pub fn every_setting() -> Vec<Settings> {
    let mut all = Vec::new();
    for coverage in [Coverage::Quad, Coverage::Rectangle] {
        for trails in [Trails::Uncovered, Trails::Silhouettes, Trails::All] {
            for weights in [AreaWeights::Analytic, AreaWeights::Bits] {
                for (margins, doubt) in [(true, true), (true, false), (false, true), (false, false)] {
                    all.push(Settings { coverage, trails, weights, margins, doubt });
                }
            }
        }
    }
    all
}

/// Rays from a point.
pub struct Rays<F>(pub Vec3A, pub F);

impl<F> std::fmt::Debug for Rays<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Rays").field(&self.0).finish_non_exhaustive()
    }
}

impl<F: Fn(Vec3A, Vec3A) -> Seen> Tracer for Rays<F> {
    fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
        for (wi, out) in wi.iter().zip(out) {
            let (radiance, distance, normal) = (self.1)(self.0, *wi);
            *out = Traced { radiance, distance, normal };
        }
    }
}

/// What elements weigh and the holes together, before they are normalised to one: for a record that saw red light of
/// radiance 1 alone, which was just projected. Where holes are black, what is left of the light is the part of the
/// elements. NaN where there are no holes.
pub fn weight_before_normalising(workspace: &mut Workspace, shares: Shares) -> f32 {
    workspace.trace_holes(1, 1, &mut Rays(Vec3A::ZERO, |_, wi: Vec3A| (Vec3::ZERO, 1.0, -wi)));
    shares.holes / (1.0 - workspace.mean_radiance().x)
}

/// Mean radiance over the cosine-weighted hemisphere by `side x side` stratified rays.
pub fn gather(look: impl Fn(Vec3A, Vec3A) -> Seen, p: Vec3A, frame: &Frame, side: usize) -> Vec3 {
    let mut sum = glam::DVec3::ZERO;
    for k in 0..side * side {
        let place = Vec2::new((k % side) as f32 + 0.5, (k / side) as f32 + 0.5) / side as f32;
        sum += look(p, frame.to_world(hemimap::square_to_cosine_hemisphere(place))).0.as_dvec3();
    }
    (sum / (side * side) as f64).as_vec3()
}
