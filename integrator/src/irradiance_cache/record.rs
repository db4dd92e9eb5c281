//! Where a record reaches, and what it says there.
//!
//! The distance of a point from a record is 0 at the record and 1 where it ends to matter. Of the offset d it counts
//! the tangential part in units of the ellipse's half axes, the height over the tangent plane and the turn of the
//! normal:
//!
//! ```text
//! distance^2 = (d . a / R_a)^2 + (d . b / R_b)^2 + (h / (0.2 R_a))^2 + (1 - n . n') / (1 - 0.9)
//! ```
//!
//! What stands close above a point hides light from it that the record saw: such a gap takes records of its own.
//!
//! A record must not reach through walls, and its radii know nothing of them where the light does not change. So it
//! keeps the planes of what it met near its horizon: no point behind one of them may take anything from it (as Ward's
//! `ambcorral` in Radiance, which keeps azimuths in their place).

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::Samples;

use super::edges::{Derivatives, Gradient, TexelEdges};
use super::hessian::radius;
use crate::sky::luminance;

/// Rules for the reach of one record. Lengths are metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RecordRules {
    /// Error that the record may sum to, relative to its irradiance, square metres.
    pub(crate) total_error: f32,
    /// Smallest radius; nearer things count as if they were so far away.
    pub(crate) min_radius: f32,
    /// Radius where light comes by highlights, which is smaller.
    pub(crate) highlight_radius: f32,
    /// Largest radius.
    pub(crate) max_radius: f32,
    /// The same of those by the Hessian, as a share of the harmonic mean distance.
    pub(crate) max_share_of_distance: f32,
    /// Whether the Hessian says how far it reaches, or Ward's rule.
    pub(crate) by_hessian: bool,
    /// Whether it knows the gradients.
    pub(crate) gradients: bool,
    /// Whether it stops at walls.
    pub(crate) walls: bool,
    /// Whether gaps that it is not in take records of their own.
    pub(crate) gaps: bool,
}

/// Irradiance at one point of a surface, its derivatives, and how far they hold.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Record {
    centre: Vec3A,
    frame: Frame,
    /// Mean radiance over the cosine-weighted hemisphere, irradiance / pi: of what stands at a distance, and of the
    /// soft sky.
    mean: [Vec3; 2],
    translation: [Gradient; 2],
    rotation: [Gradient; 2],
    /// Turns an offset into its parts along the half axes and over the tangent plane, in units of the reach along each.
    to_reaches: Mat3A,
    /// Half axes, the smaller first.
    radii: [f32; 2],
    /// The height of the lowest thing overhead.
    clearance: f32,
    guards: Vec<Guard>,
}

/// A point that asks for light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// Where it is, world space, metres.
    pub(crate) p: Vec3A,
    /// Its unit normal.
    pub(crate) n: Vec3A,
    /// The distance to what stands above it, metres.
    pub(crate) clearance: f32,
}

/// A plane that the record saw from its front.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Guard {
    /// Its normal, world space, divided by the record's distance from it.
    normal: Vec3A,
}

/// Smallest cosine between the normals of a record and of a point that it serves: 26 degrees.
pub(super) const MIN_NORMAL_COS: f32 = 0.9;
/// Height over the tangent plane counts so many times as much as the offset along it, and at most this share of the
/// offset is height: surfaces whose normals differ by 26 degrees bend away from it by half the angle.
const HEIGHT_FACTOR: f32 = 5.0;
/// Rounding of far coordinates must not make near points steep.
const STEEP_SLACK: f32 = 0.01;
/// Longest ellipse: the Hessian of few texels is too rough for more.
const MAX_ASPECT: f32 = 2.0;
/// Light that comes by a smaller share of the texels than this is too rough for derivatives; and a reach by its Hessian
/// would be the shorter the more of it was met by chance, so that the records that met none would have the greatest
/// say. Such a record reaches a share of the harmonic mean distance, by Ward's rule, which knows geometry alone, and no
/// farther than by the Hessian of what is left of its light without the brightest: else those that met it would have
/// the greatest say.
const FEW_TEXELS: f32 = 0.015;
/// What is left must come by so many of them.
const MANY_TEXELS: f32 = 0.1;
const WARD_SPACING: f32 = 0.3;
/// No reach is longer, metres, also where all is infinitely far and nothing else limits it: squares of its ratio to
/// short ones are numbers.
const FARTHEST: f32 = 1e10;
/// Texels above this cosine are overhead.
const OVERHEAD_COS: f32 = 0.95;
/// A point with less than this share of the record's clearance, and less than its distance from the record, is in a gap
/// that the record is not in.
const GAP: f32 = 0.1;
/// Texels below this cosine are near enough to the horizon for what they met to stand in the way of a point of the
/// surface.
const GUARD_COS: f32 = 0.7;
/// Planes that rise from the tangent plane less steeply than this, by the tangential part of their normals, do not.
const GUARD_SLOPE: f32 = 0.3;
/// Of planes whose normals lie in one of so many sectors, the nearest is kept.
const GUARD_SECTORS: usize = 8;
/// The weight of a record falls to 0 in the last part of the way to a plane: a quarter.
const GUARD_RAMP: f32 = 4.0;

impl Record {
    /// Makes a record of what is seen from `centre` in `frame`. `mean` is its mean radiance, of what stands at a
    /// distance and of the soft sky, which may be better known than as the mean of the texels.
    pub(crate) fn new(
        centre: Vec3A,
        frame: Frame,
        samples: &Samples,
        mean: [Vec3; 2],
        edges: &TexelEdges,
        rules: &RecordRules,
    ) -> Self {
        let far = samples.harmonic_distance();
        let directions = samples.directions();
        let limited = |radius: f32| radius.min(rules.max_radius).min(FARTHEST).max(rules.min_radius);
        let farthest = rules.max_share_of_distance * far;
        let is_lit_by_few = is_lit_by_few(samples);
        let derivatives_of = |samples: &Samples| edges.derivatives(samples, &directions, rules.min_radius);
        let derivatives = (!is_lit_by_few).then(|| derivatives_of(samples));
        let by_hessian = |derivatives: &Derivatives, light: f32| {
            let (curvatures, axis) = derivatives.hessian.eigen();
            // Where the first derivative is so large, light falls to 0 within the radius: no second derivative tells of
            // that.
            let [near, sky] = derivatives.translation;
            let slope = Vec2::new(luminance(near[0] + sky[0]), luminance(near[1] + sky[1]));
            let fall = light / slope.length();
            let radius = |curvature| radius(curvature, rules.total_error * light).min(fall).min(farthest);
            (curvatures.map(|curvature| limited(radius(curvature))), axis)
        };
        let by_geometry = limited(WARD_SPACING * far);
        let (radii, axis) = if is_lit_by_few && is_lit_by_highlights(samples) {
            // Where they end, no geometry tells.
            ([rules.highlight_radius; 2], Vec2::X)
        } else if !rules.by_hessian {
            ([by_geometry; 2], Vec2::X)
        } else if let Some(derivatives) = &derivatives {
            by_hessian(derivatives, luminance(mean[0] + mean[1]))
        } else if let Some(capped) = capped(samples) {
            let light = luminance(capped.mean_radiance_by_distance().into_iter().sum());
            let (radii, axis) = by_hessian(&derivatives_of(&capped), light);
            (radii.map(|radius| radius.min(by_geometry)), axis)
        } else {
            ([by_geometry; 2], Vec2::X)
        };
        let [first, second] = [radii[0], radii[1].min(MAX_ASPECT * radii[0])];
        let Derivatives { translation, rotation, .. } = derivatives.filter(|_| rules.gradients).unwrap_or_default();
        let along = |axis: Vec2, radius: f32| (frame.s * axis.x + frame.t * axis.y) / radius;
        let height = frame.n * (HEIGHT_FACTOR / first);
        let to_reaches = Mat3A::from_cols(along(axis, first), along(axis.perp(), second), height).transpose();
        let guards = if rules.walls { guards(samples, &directions, &frame, second) } else { Vec::new() };
        let heights = directions.iter().zip(&samples.distance).filter(|(wi, _)| wi.z > OVERHEAD_COS);
        // Nothing is in a gap of a record without height.
        let clearance =
            if rules.gaps { heights.map(|(wi, distance)| wi.z * distance).fold(f32::INFINITY, f32::min) } else { 0.0 };
        Self { centre, frame, mean, translation, rotation, to_reaches, radii: [first, second], clearance, guards }
    }

    /// Reaches no farther than so many metres where it reaches least, and less in proportion elsewhere.
    pub(crate) fn clamp_reach(&mut self, least: f32) {
        if least < self.radii[0] {
            let share = least / self.radii[0];
            self.radii = self.radii.map(|radius| share * radius);
            self.to_reaches *= 1.0 / share;
        }
    }

    /// Where it was made, world space, metres.
    pub(crate) fn centre(&self) -> Vec3A {
        self.centre
    }

    /// The unit normal there, world space.
    pub(crate) fn normal(&self) -> Vec3A {
        self.frame.n
    }

    /// Mean radiance over the projected hemisphere, W m^-2 sr^-1.
    pub(crate) fn mean_radiance(&self) -> Vec3 {
        self.mean[0] + self.mean[1]
    }

    /// No point farther off than this takes anything from it, metres.
    pub(crate) fn reach(&self) -> f32 {
        self.radii[1]
    }

    /// How far it reaches where it reaches least, metres.
    pub(crate) fn least_reach(&self) -> f32 {
        self.radii[0]
    }

    /// How far off a place is, in units of the record's reach: it serves those below 1.
    pub(crate) fn distance(&self, place: &Place) -> f32 {
        let &Place { p, n, clearance } = place;
        let cos = n.dot(self.frame.n);
        if cos < MIN_NORMAL_COS {
            return f32::INFINITY;
        }
        let offset = p - self.centre;
        let parts = self.to_reaches * offset;
        let turn = (1.0 - cos).max(0.0) / (1.0 - MIN_NORMAL_COS);
        let distance_sq = parts.length_squared() + turn;
        let steep = (parts.z.abs() - STEEP_SLACK) * self.radii[0] > offset.length();
        let is_in_gap = clearance < (GAP * self.clearance).min(offset.length());
        // What is no number is not within either.
        let is_within = distance_sq < 1.0;
        if !is_within || steep || is_in_gap {
            return f32::INFINITY;
        }
        let front = self.guards.iter().map(|guard| 1.0 + guard.normal.dot(offset)).fold(f32::INFINITY, f32::min);
        distance_sq.sqrt().max(1.0 - GUARD_RAMP * front)
    }

    /// What it tells of the light at a point with unit normal `n`: mean radiance of what stands at a distance, and of
    /// the soft sky. May be negative.
    pub(crate) fn light(&self, p: Vec3A, n: Vec3A) -> [Vec3; 2] {
        let (s, t) = (self.frame.s, self.frame.t);
        let offset = p - self.centre;
        let moved = [offset.dot(s), offset.dot(t)];
        let turned = [n.dot(s), n.dot(t)];
        let part = |part: usize| {
            let [along_s, along_t] = self.translation[part];
            let [towards_s, towards_t] = self.rotation[part];
            self.mean[part] + along_s * moved[0] + along_t * moved[1] + towards_s * turned[0] + towards_t * turned[1]
        };
        [part(0), part(1)]
    }

    /// Bytes that it takes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.guards.capacity() * size_of::<Guard>()
    }
}

/// Whether so few texels bring the light that chance decides how much it is.
pub(crate) fn is_lit_by_few(samples: &Samples) -> bool {
    lit_share(samples) < FEW_TEXELS
}

/// Whether most of the light comes by highlights, which other points see elsewhere.
fn is_lit_by_highlights(samples: &Samples) -> bool {
    let light = |texel: usize| luminance(samples.radiance[texel]);
    let all = 0..samples.radiance.len();
    let marked: f32 = all.clone().filter(|&texel| samples.view_dependent[texel]).map(light).sum();
    2.0 * marked > all.map(light).sum()
}

/// Share of the texels that bring the light of a gather, if all of them were equally bright; 0 in the dark.
fn lit_share(samples: &Samples) -> f32 {
    let light = samples.radiance.iter().map(|&radiance| luminance(radiance));
    let (sum, sum_sq) = light.fold((0.0, 0.0), |(sum, sum_sq), l| (sum + l, sum_sq + l * l));
    if sum_sq > 0.0 { share_of(sum, sum_sq, samples.radiance.len() as f32) } else { 0.0 }
}

/// The same of texels whose light and its square, above 0, have these sums.
fn share_of(sum: f32, sum_sq: f32, count: f32) -> f32 {
    sum / sum_sq * sum / count
}

/// Samples without so much of the brightest light that many texels bring the rest; `None` if none is left.
fn capped(samples: &Samples) -> Option<Samples> {
    let mut bright: Vec<f32> = samples.radiance.iter().map(|&radiance| luminance(radiance)).collect();
    bright.sort_by(f32::total_cmp);
    let count = bright.len() as f32;
    let (mut sum, mut sum_sq) = (0.0, 0.0);
    let mut cap = 0.0;
    for (number, &l) in bright.iter().enumerate() {
        let above = count - number as f32;
        let (all, all_sq) = (sum + above * l, sum_sq + above * l * l);
        if all_sq > 0.0 && share_of(all, all_sq, count) >= MANY_TEXELS {
            cap = l;
        }
        sum += l;
        sum_sq += l * l;
    }
    (cap > 0.0).then(|| {
        let mut capped = samples.clone();
        for radiance in &mut capped.radiance {
            *radiance *= (cap / luminance(*radiance)).min(1.0);
        }
        capped
    })
}

/// The nearest planes of what a gather met near its horizon, by the azimuth of their normals; none that is farther than
/// `reach`.
fn guards(samples: &Samples, directions: &[Vec3A], frame: &Frame, reach: f32) -> Vec<Guard> {
    let mut nearest: [Option<(f32, Vec3A)>; GUARD_SECTORS] = [None; GUARD_SECTORS];
    for (texel, &wi) in directions.iter().enumerate() {
        if wi.z > GUARD_COS || samples.distance[texel].is_infinite() {
            continue;
        }
        let normal = Vec3A::from(samples.normal[texel]);
        let slope = normal.truncate().length();
        let distance = -samples.distance[texel] * wi.dot(normal);
        if slope < GUARD_SLOPE || distance <= 0.0 || distance > reach {
            continue;
        }
        let turn = normal.y.atan2(normal.x) / std::f32::consts::TAU + 0.5;
        let sectors = u32::try_from(GUARD_SECTORS).expect("a few");
        let sector = hemimap::texel_index(turn, sectors) as usize;
        if nearest[sector].is_none_or(|(other, _)| distance < other) {
            nearest[sector] = Some((distance, normal));
        }
    }
    let planes = nearest.into_iter().flatten();
    planes.map(|(distance, normal)| Guard { normal: frame.to_world(normal) / distance }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 32;
    const RULES: RecordRules = RecordRules {
        total_error: 1e-3,
        min_radius: 1e-3,
        highlight_radius: 5e-4,
        max_radius: 10.0,
        max_share_of_distance: 1.0,
        by_hessian: true,
        gradients: true,
        walls: true,
        gaps: true,
    };

    fn record(rules: &RecordRules, look: impl FnMut(Vec3A) -> (Vec3, f32, Vec3A)) -> Record {
        let frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };
        let samples = Samples::from_fn(N, look);
        let mean = samples.mean_radiance_by_distance();
        Record::new(Vec3A::ZERO, frame, &samples, mean, &TexelEdges::new(N, 1), rules)
    }

    /// A place under the open sky.
    fn open(p: Vec3A, n: Vec3A) -> Place {
        Place { p, n, clearance: f32::INFINITY }
    }

    /// An endless wall of radiance 1 and height 1 at x = 1, black night elsewhere.
    fn low_wall(wi: Vec3A) -> (Vec3, f32, Vec3A) {
        if wi.x > 0.0 && wi.z < wi.x { (Vec3::ONE, 1.0 / wi.x, Vec3A::NEG_X) } else { (Vec3::ZERO, f32::INFINITY, -wi) }
    }

    #[test]
    fn record_beside_a_wall_serves_along_it_and_nobody_behind() {
        let lit = |wi: Vec3A| (Vec3::ONE, if wi.x > 0.0 { 1.0 / wi.x } else { f32::INFINITY }, Vec3A::NEG_X);
        let record = record(&RULES, lit);
        let distance = |x, y| record.distance(&open(Vec3A::new(x, y, 0.0), Vec3A::Z));
        assert_eq!(distance(0.0, 0.0), 0.0, "itself");
        assert!(distance(0.0, 4.0) < 1.0 && distance(-4.0, 0.0) < 1.0, "light is the same everywhere");
        assert!(distance(0.7, 4.0) < 1.0, "in front of the wall");
        assert!(distance(1.0, 0.0) >= 1.0 && distance(1.5, 3.0) >= 1.0, "behind it");
    }

    #[test]
    fn even_light_reaches_as_far_as_its_distance_lets_it() {
        let reach = |max_share_of_distance, by_hessian| {
            let rules = RecordRules { max_share_of_distance, by_hessian, ..RULES };
            record(&rules, |wi| (Vec3::ONE, 2.0, -wi)).least_reach()
        };
        for share in [1.0, 2.0] {
            assert!((reach(share, true) / (2.0 * share) - 1.0).abs() < 1e-4, "a share of {share}");
            assert!((reach(share, false) / (2.0 * WARD_SPACING) - 1.0).abs() < 1e-4, "geometry has its own");
        }
    }

    #[test]
    fn other_surfaces_are_not_served() {
        let record = record(&RULES, |wi| (Vec3::ONE, f32::INFINITY, -wi));
        assert_eq!(record.reach(), 10.0, "an open sky reaches the limit");
        let turned = Vec3A::new(0.5, 0.0, 0.75f32.sqrt());
        assert!(record.distance(&open(Vec3A::X, turned)) >= 1.0, "30 degrees");
        assert!(record.distance(&open(Vec3A::new(1.0, 0.0, -0.3), Vec3A::Z)) >= 1.0, "a step below");
        assert!(record.distance(&open(Vec3A::new(1.0, 0.0, -0.1), Vec3A::Z)) < 1.0, "a gentle slope");
    }

    #[test]
    fn highlights_that_are_all_the_light_reach_nobody() {
        let frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };
        let mut samples = Samples::from_fn(N, |wi| (Vec3::ZERO, 1.0 / wi.z, Vec3A::NEG_Z));
        let edges = TexelEdges::new(N, 1);
        let reach = |samples: &Samples| {
            Record::new(Vec3A::ZERO, frame, samples, samples.mean_radiance_by_distance(), &edges, &RULES).reach()
        };
        // Four texels of a thousand, and as much light again by 20 of them.
        (0..4).for_each(|texel| samples.radiance[100 + texel] = Vec3::splat(50.0));
        let lamp = reach(&samples);
        samples.view_dependent[90..110].fill(true);
        assert_eq!(reach(&samples), RULES.highlight_radius, "they move otherwise than what they are seen in");
        assert!(lamp > 100.0 * RULES.min_radius, "a lamp stays where it is: {lamp}");
        (0..20).for_each(|texel| samples.radiance[500 + texel] = Vec3::splat(11.0));
        assert!(is_lit_by_few(&samples));
        assert_eq!(reach(&samples), lamp, "not most of the light");
    }

    #[test]
    fn who_meets_a_bright_spot_by_chance_reaches_no_farther() {
        let rules = RecordRules { total_error: 1e-6, ..RULES };
        // A ceiling whose light changes along it, and a small bright spot that some records miss.
        let seen = |spot: f32| {
            move |wi: Vec3A| {
                let at = wi / wi.z;
                let is_spot = at.distance(Vec3A::new(0.5, 0.3, 1.0)) < 0.05;
                let light = if is_spot { spot } else { 1.0 + 0.9 * (12.0 * at.x).sin() };
                (Vec3::splat(light), at.length(), Vec3A::NEG_Z)
            }
        };
        let (missed, met) = (record(&rules, seen(1.0)), record(&rules, seen(1e4)));
        assert!(met.mean_radiance().x > 5.0 * missed.mean_radiance().x, "the spot is nearly all the light");
        assert!(met.reach() < 1.1 * missed.reach(), "{} and {}", met.reach(), missed.reach());
    }

    #[test]
    fn gaps_take_records_of_their_own() {
        let record = record(&RULES, |wi| (Vec3::ONE, 3.0 / wi.z, Vec3A::NEG_Z));
        let serves = |x: f32, clearance: f32| record.distance(&Place { p: Vec3A::X * x, n: Vec3A::Z, clearance }) < 1.0;
        assert!(serves(0.5, 3.0) && serves(0.5, 1.0), "under the ceiling, and under a table");
        assert!(!serves(0.5, 0.1), "not deep in a gap");
        assert!(serves(0.05, 0.1), "but at its mouth");
    }

    #[test]
    fn gradients_tell_the_light_nearby() {
        // At the distance d from the wall, E / pi = (1 - d / sqrt(1 + d^2)) / 2.
        let record = record(&RULES, low_wall);
        let known = |d: f32| 0.5 * (1.0 - d / (1.0 + d * d).sqrt());
        for x in [-0.1f32, -0.05, 0.05, 0.1] {
            let [near, sky] = record.light(Vec3A::X * x, Vec3A::Z);
            // What the second derivative leaves, and the texels of the wall's upper rim.
            assert!((near.x - known(1.0 - x)).abs() < 4e-3, "{} instead of {} at {x}", near.x, known(1.0 - x));
            assert!((near.x - record.light(Vec3A::ZERO, Vec3A::Z)[0].x).abs() > 6e-3, "it changes at {x}");
            assert_eq!(sky, Vec3::ZERO, "no sky");
        }
        // The wall fills the elevations a from 0 to 45 degrees: turned, E / pi gains half the integral of cos(a).
        let [near, _] = record.light(Vec3A::ZERO, Vec3A::new(0.1, 0.0, 0.995));
        let towards = 0.5 * std::f32::consts::FRAC_1_SQRT_2;
        assert!((near.x - record.light(Vec3A::ZERO, Vec3A::Z)[0].x - 0.1 * towards).abs() < 1e-3, "turned to the wall");
    }

    #[test]
    fn reach_grows_with_the_fourth_root_of_the_error_and_is_longer_along_the_wall() {
        let reach = |total_error| record(&RecordRules { total_error, ..RULES }, low_wall).radii;
        let ([a0, b0], [a1, b1]) = (reach(1e-6), reach(16e-6));
        assert!((a1 / a0 - 2.0).abs() < 1e-3 && (b1 / b0 - 2.0).abs() < 1e-3, "{a0} {b0} to {a1} {b1}");
        assert_eq!(b0, MAX_ASPECT * a0, "light does not change along the wall");
        let along = record(&RecordRules { total_error: 1e-6, ..RULES }, low_wall);
        let distance = |p: Vec3A| along.distance(&open(p, Vec3A::Z));
        assert!((distance(Vec3A::Y * 0.5 * b0) - 0.5).abs() < 1e-3, "half way along the wall");
        assert!((distance(Vec3A::X * 0.5 * a0) - 0.5).abs() < 1e-3, "half way to the wall");
    }

    #[test]
    fn reach_keeps_its_limits() {
        let tight = RecordRules { total_error: 1e-12, min_radius: 0.01, ..RULES };
        assert_eq!(record(&tight, low_wall).radii[0], 0.01, "the least");
        let mut endless =
            record(&RecordRules { max_radius: f32::INFINITY, ..RULES }, |wi| (Vec3::ONE, f32::INFINITY, -wi));
        assert!(endless.radii[0].is_finite() && endless.distance(&open(Vec3A::X, Vec3A::Z)) < 1.0, "without a limit");
        endless.clamp_reach(2.0);
        assert!((endless.distance(&open(Vec3A::X, Vec3A::Z)) - 0.5).abs() < 1e-3, "beside one that reaches less far");
        endless.clamp_reach(1e-6);
        assert!(
            (endless.distance(&open(Vec3A::X * 0.9999e-6, Vec3A::Z)) - 1.0).abs() < 1e-3,
            "beside one that hardly reaches"
        );
        let dark = record(&RULES, |wi| (Vec3::ZERO, 1.0 / wi.z, Vec3A::NEG_Z));
        let ward = dark.radii[0];
        assert!((ward - 0.45).abs() < 5e-3 && dark.radii[1] == ward, "0.3 times 1.5 times the height, not {ward}");
        assert_eq!(dark.light(Vec3A::X, Vec3A::Z), [Vec3::ZERO; 2], "and stays dark");
    }
}
