//! The reprojection itself: where the point lies, what it cannot see, and what the kernel found.

use glam::{Mat3A, Vec3, Vec3A};
use radcache::Record;

use crate::kernel::{self, Task};
use crate::workspace::Mark;
use crate::{Settings, Shares, Workspace};

impl Workspace {
    /// Projects the elements of a record to a point `p` with unit normal `n` in world space, nearest layer first.
    ///
    /// Bits that an element of a nearer layer filled, or that a nearer layer made unknown, are closed to it, and so is
    /// what silhouettes of its own layer uncovered. An element that is seen from behind, or whose radiance depends on
    /// the view, fills nothing and makes unknown what it covers: the record knows only its front, from its own place.
    /// That, and [`Trails::All`](crate::Trails::All), count from the next layer on (paper, section 5.3).
    pub fn project(&mut self, record: &Record, p: Vec3A, n: Vec3A, settings: &Settings) -> Shares {
        self.project_above(record, p, n, n, settings)
    }

    /// [`Self::project`] to a point whose surface has the unit normal `ng`, while `n` is that of its shading: what lies
    /// below the surface is filled with black, as nothing comes from there whatever the record saw.
    pub fn project_above(&mut self, record: &Record, p: Vec3A, n: Vec3A, ng: Vec3A, settings: &Settings) -> Shares {
        self.place(record, p, n);
        self.masks.reset(self.n);
        let buried = self.bury(ng);
        if settings.doubt {
            self.doubt(record);
        }
        let task = Task {
            elements: record.elements(),
            rotation: self.rotation,
            offset: self.offset,
            n: self.n,
            settings: *settings,
        };
        let sums = if self.is_narrow() {
            kernel::run(self.kernel, &task, &mut self.masks, &mut self.narrow)
        } else {
            kernel::run(self.kernel, &task, &mut self.masks, &mut self.wide)
        };
        let [weight, r, g, b, far_r, far_g, far_b] = sums;
        let texels = (self.n * self.n) as f32;
        self.filled_sum = [Vec3::new(r, g, b), Vec3::new(far_r, far_g, far_b)];
        self.filled_weight = weight + buried as f32 / texels;
        self.has_owners = false;
        self.holes.clear();
        self.traced.clear();
        let filled = self.masks.count(&self.masks.fill) as f32 / texels;
        let unknown = self.masks.count(&self.masks.unknown) as f32 / texels;
        Shares { filled, unknown, holes: 1.0 - filled }
    }

    fn place(&mut self, record: &Record, p: Vec3A, n: Vec3A) {
        let frame = record.frame();
        self.projected = Some(Mark::of(record));
        self.n = record.samples().resolution();
        self.offset = frame.to_local(p - record.centre());
        if n == frame.n {
            // Exactly, so that a record gives itself back bit for bit.
            self.frame = frame;
            self.rotation = Mat3A::IDENTITY;
        } else {
            self.frame = frame.transported_to(n);
            let column = |axis| self.frame.to_local(axis);
            self.rotation = Mat3A::from_cols(column(frame.s), column(frame.t), column(frame.n));
        }
    }
}
