//! Verification: a few rays that ask whether the reprojected elements are really there.
//!
//! No reprojection can know what a record could not see, such as the inside of a thin gap. Four rays find nearly all of it.

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
    /// Rays that met something else than the element that fills their texel.
    pub wrong: u32,
}

impl Workspace {
    /// Traces `side x side` stratified rays, 16 x 16 at most, and compares what each meets with the element that fills its texel. To be called
    /// between [`Self::project`] and [`Self::trace_holes`], whose buffers it uses.
    ///
    /// # Panics
    /// If `record` is not the one that was projected last.
    pub fn verify(&mut self, record: &Record, side: u32, seed: u64, tracer: &mut impl Tracer) -> Verdict {
        self.assert_projected(record);
        self.directions.clear();
        self.holes.clear();
        let mut owners = [0usize; MAX_SIDE * MAX_SIDE];
        let mut asked = 0;
        let side = (side as usize).min(MAX_SIDE);
        for cell in 0..side * side {
            let random = hash(seed, cell as u64);
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

/// Most verification rays along a side.
const MAX_SIDE: usize = 16;

/// The low 24 bits as a number in [0, 1).
fn unit(bits: u64) -> f32 {
    (bits & 0xff_ffff) as f32 / 16_777_216.0
}

fn texel_at(place: Vec2, n: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "n <= 64")]
    let [i, j] = place.to_array().map(|x| hemimap::texel_index(x, n as u32) as usize);
    j * n + i
}
