//! Verification: a few rays that ask whether the reprojected elements are really there.
//!
//! No reprojection can know what a record could not see, such as the inside of a thin gap. Four rays find nearly all of
//! it.

use glam::{Mat3A, Vec2, Vec3A};
use radcache::Record;

use crate::holes::hash;
use crate::{Traced, Tracer, Workspace};

/// Off the element's plane by more than this share of the distance, a hit is something else...
const OFF_PLANE: f32 = 0.1;
/// ... if it is also away from the element's centre by this share.
const OFF_CENTRE: f32 = 0.25;

/// What verification rays found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Verdict {
    /// Rays that met a filled texel, and so could be compared.
    pub asked: u32,
    /// Rays that met something else than the element that fills their texel. Elements at the rim of the hemisphere do
    /// not know their plane, so some of these rays are wrong about that: in a hall ten times as wide as it is high one
    /// of 16 (n = 32), in rooms hardly any.
    pub wrong: u32,
}

impl Verdict {
    /// Whether the record may be used: less than half of the rays are wrong, and there are some. Where elements cover
    /// too little to ask, the record knows too little.
    ///
    /// ```
    /// use reproject::Verdict;
    ///
    /// assert!(Verdict { asked: 4, wrong: 1 }.holds());
    /// assert!(!Verdict { asked: 4, wrong: 2 }.holds());
    /// assert!(!Verdict { asked: 0, wrong: 0 }.holds());
    /// ```
    #[must_use]
    pub const fn holds(&self) -> bool {
        self.wrong < self.asked.saturating_sub(self.wrong)
    }
}

impl Workspace {
    /// Traces `side x side` stratified rays, 16 x 16 at most, and compares what each meets with the element that fills
    /// its texel. To be called between [`Self::project`] and [`Self::trace_holes`], whose buffers it uses.
    ///
    /// # Panics
    /// If `record` is not the one that was projected last, as far as place, frame and number of elements tell.
    pub fn verify(&mut self, record: &Record, side: u32, seed: u64, tracer: &mut (impl Tracer + ?Sized)) -> Verdict {
        self.assert_projected(record);
        self.directions.clear();
        self.holes.clear();
        let mut owners = [0usize; MAX_SIDE * MAX_SIDE];
        let mut asked = 0;
        let side = (side as usize).min(MAX_SIDE);
        for cell in 0..side * side {
            let random = hash(seed ^ STREAM, cell as u64);
            let jitter = Vec2::new(unit(random >> 40), unit(random >> 16));
            let place = (Vec2::new((cell % side) as f32, (cell / side) as f32) + jitter) / side as f32;
            let texel = texel_at(place, self.n);
            if let Some(owner) = self.owner(texel) {
                owners[asked] = owner;
                asked += 1;
                let wi = self.frame.to_world(hemimap::square_to_cosine_hemisphere(place));
                self.directions.push(wi);
            }
        }
        self.traced.clear();
        self.traced.resize(asked, Traced::default());
        tracer.probe(&self.directions, &mut self.traced);
        let wrong = (0..asked).filter(|&k| {
            let wi = record.frame().to_local(self.directions[k]);
            !self.agrees(record, owners[k], wi, self.traced[k].distance)
        });
        let wrong = wrong.count();
        self.traced.clear();
        #[expect(clippy::cast_possible_truncation, reason = "at most 16 x 16 rays")]
        let verdict = Verdict { asked: asked as u32, wrong: wrong as u32 };
        verdict
    }

    /// Whether a ray along `wi`, in the frame of the record, that ended at `distance` met element `e`.
    fn agrees(&self, record: &Record, e: usize, wi: Vec3A, distance: f32) -> bool {
        let elements = record.elements();
        if elements.finite[e] == 0.0 {
            return distance.is_infinite();
        }
        if distance.is_infinite() {
            return false;
        }
        let corners = Mat3A::from_cols(elements.corner(e, 0), elements.corner(e, 1), elements.corner(e, 2));
        let last = elements.corner(e, 3);
        let centre = (corners.x_axis + corners.y_axis + corners.z_axis + last) / 4.0;
        let normal = (corners.z_axis - corners.x_axis).cross(last - corners.y_axis).normalize_or_zero();
        let off = self.offset + wi * distance - centre;
        normal.dot(off).abs() <= OFF_PLANE * distance || off.length() <= OFF_CENTRE * distance
    }
}

/// Keeps the random numbers of verification rays apart from those of hole rays with the same seed.
const STREAM: u64 = 0x7665_7269_6679;

/// Most verification rays along a side.
const MAX_SIDE: usize = 16;

/// The low 24 bits as a number in [0, 1).
pub(crate) fn unit(bits: u64) -> f32 {
    (bits & 0xff_ffff) as f32 / 16_777_216.0
}

/// The texel that holds a place of the square.
pub(crate) fn texel_at(place: Vec2, n: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "n <= 64")]
    let [i, j] = place.to_array().map(|x| hemimap::texel_index(x, n as u32) as usize);
    j * n + i
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use hemimap::Frame;
    use proptest::prelude::*;
    use radcache::{RecordSettings, Samples, Validity};

    use crate::Settings;

    /// What a point under a slanting roof sees, and at the side the sky.
    fn roof() -> Record {
        let normal = Vec3A::new(0.36, -0.48, -0.8);
        let samples = Samples::from_fn(8, |wi| {
            let distance = normal.z / normal.dot(wi);
            let is_sky = !(0.0..3.0).contains(&distance);
            (Vec3::ONE, if is_sky { f32::INFINITY } else { distance }, if is_sky { -wi } else { normal })
        });
        Record::new(
            Vec3A::ZERO,
            Frame::from_normal(Vec3A::Z),
            samples,
            &RecordSettings::default(),
            &Validity::default(),
        )
    }

    proptest! {
        #[test]
        fn hits_agree_on_the_plane_of_the_element_or_near_its_centre(
            e in 0usize..1000, h in -0.5f32..0.5, t in -1f32..1.0, to in prop::array::uniform3(-0.2f32..0.2),
        ) {
            let record = roof();
            let elements = record.elements();
            let mut workspace = Workspace::new();
            workspace.project(&record, Vec3A::from(to), Vec3A::Z, &Settings::default());
            let e = e % elements.len();
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| elements.corner(e, k).as_dvec3());
            let wi = (a + b + c + d).normalize().as_vec3a();
            if elements.finite[e] == 0.0 {
                prop_assert!(workspace.agrees(&record, e, wi, f32::INFINITY), "the sky is there");
                prop_assert!(!workspace.agrees(&record, e, wi, 1e6), "something stands before the sky");
                return Ok(());
            }
            prop_assert!(!workspace.agrees(&record, e, wi, f32::INFINITY), "only the sky is there");
            // A hit beside the centre of the element, by h along its normal and by t across.
            let (centre, normal) = ((a + b + c + d) / 4.0, (c - a).cross(d - b).normalize());
            let off = normal * f64::from(h) + normal.any_orthonormal_vector() * f64::from(t);
            let ray = centre + off - Vec3A::from(to).as_dvec3();
            let [from_plane, from_centre] = [f64::from(h).abs(), off.length()].map(|off| off / ray.length());
            prop_assume!((from_plane - 0.1).abs() > 1e-4 && (from_centre - 0.25).abs() > 1e-4);
            let agrees = workspace.agrees(&record, e, ray.normalize().as_vec3a(), ray.as_vec3a().length());
            prop_assert_eq!(agrees, from_plane <= 0.1 || from_centre <= 0.25);
        }
    }

    /// Answers by what it is told to, and keeps what it was asked.
    struct Told<F>(F, Vec<Vec3A>);

    impl<F: Fn(Vec3A) -> f32> Tracer for Told<F> {
        fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
            self.1.extend_from_slice(wi);
            wi.iter().zip(out).for_each(|(wi, out)| out.distance = (self.0)(*wi));
        }
    }

    #[test]
    fn rays_are_stratified_and_compared_with_what_fills_their_own_texel() {
        // Half a dome, and half of a larger one.
        let distance = |wi: Vec3A| if wi.x < 0.0 { 1.0 } else { 4.0 };
        let samples = Samples::from_fn(32, |wi| (Vec3::ONE, distance(wi), -wi));
        let frame = Frame::from_normal(Vec3A::Z);
        let record = Record::new(Vec3A::ZERO, frame, samples, &RecordSettings::default(), &Validity::default());
        let mut workspace = Workspace::new();
        workspace.project(&record, Vec3A::ZERO, Vec3A::Z, &Settings::default());
        // Where rays fall in their cells: of 8 x 8 bins, each gets 256 of 16384 on the average, and 16 times the square
        // root of one.
        let mut bins = [[0u32; 8]; 8];
        for seed in 0..64 {
            let mut truth = Told(distance, Vec::new());
            let found = workspace.verify(&record, 16, seed, &mut truth);
            assert_eq!(found, Verdict { asked: 256, wrong: 0 }, "everything is there");
            let lies = workspace.verify(&record, 16, seed, &mut Told(|wi: Vec3A| distance(-wi), Vec::new()));
            assert_eq!(lies, Verdict { asked: 256, wrong: 256 }, "the sides are exchanged");
            let half = |wi: Vec3A| if wi.y < 0.0 { 9.0 } else { distance(wi) };
            let half = workspace.verify(&record, 16, seed, &mut Told(half, Vec::new()));
            assert_eq!(half, Verdict { asked: 256, wrong: 128 }, "half of the rays end elsewhere");
            for (cell, wi) in truth.1.into_iter().enumerate() {
                let place = hemimap::cosine_hemisphere_to_square(wi) * 16.0;
                let inside = place - Vec2::new((cell % 16) as f32, (cell / 16) as f32);
                assert!(inside.cmpge(Vec2::splat(-1e-3)).all() && inside.cmple(Vec2::splat(1.001)).all(), "{inside}");
                bins[texel_at(inside, 8) / 8][texel_at(inside, 8) % 8] += 1;
            }
        }
        let chi_sq: f32 = bins.iter().flatten().map(|&count| (count as f32 - 256.0).powi(2) / 256.0).sum();
        assert!(chi_sq < 120.0, "63 degrees of freedom: {chi_sq}");
    }
}
