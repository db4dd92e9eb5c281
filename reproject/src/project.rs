//! The reprojection itself: layers from front to back, masks and weights.

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use radcache::{Elements, LANES, Record};

use crate::clip::{MAX_CLIPPED, clip_at_horizon, signed_area};
use crate::kernel::project_corners;
use crate::raster::{polygon_rows, rectangle_rows};
use crate::trail::{sweep_all, sweep_silhouettes};
use crate::workspace::NOBODY;
use crate::{AreaWeights, Coverage, Settings, Shares, Trails, Workspace};

/// Corners whose cosine is this little below the horizon are on it: rounding of a rotation moves those of the rim so far.
const HORIZON: f32 = 1e-6;

/// Texels that get their owner at once.
const RUN: usize = 8;

impl Workspace {
    /// Projects the elements of a record to a point `p` with unit normal `n` in world space, nearest layer first.
    ///
    /// Bits that an element of a nearer layer filled, or that a nearer layer made unknown, are closed to it; what its own layer
    /// made unknown counts from the next layer on (paper, section 5.3). An element that is seen from behind, or whose radiance
    /// depends on the view, fills nothing and makes unknown what it covers: the record knows only its front, from its own place.
    pub fn project(&mut self, record: &Record, p: Vec3A, n: Vec3A, settings: &Settings) -> Shares {
        self.project_above(record, p, n, n, settings)
    }

    /// [`Self::project`] to a point whose surface has the unit normal `ng`, while `n` is that of its shading: what lies below the surface
    /// is filled with black, as nothing comes from there whatever the record saw.
    pub fn project_above(&mut self, record: &Record, p: Vec3A, n: Vec3A, ng: Vec3A, settings: &Settings) -> Shares {
        self.place(record, p, n);
        let elements = record.elements();
        let padded = elements.padded_len();
        for corner in self.u.iter_mut().chain(&mut self.v).chain(&mut self.z) {
            corner.resize(padded, 0.0);
        }
        self.weight.clear();
        self.weight.resize(padded, 0.0);
        self.owner.clear();
        self.owner.resize(self.n * self.n + RUN, NOBODY);
        self.masks.reset(self.n);
        let buried = self.bury(ng);
        self.doubt(record);
        project_corners(elements, &self.rotation, self.offset, &mut self.u, &mut self.v, &mut self.z);
        for layer in 0..elements.layer_count() {
            let layer = elements.layer(layer);
            if layer.is_empty() {
                continue;
            }
            for e in layer {
                let place = std::array::from_fn(|k| Vec2::new(self.u[k][e], self.v[k][e]));
                self.fill_element(elements, e, &place, settings);
                let sweep = match settings.trails {
                    Trails::Silhouettes => sweep_silhouettes,
                    Trails::All => sweep_all,
                };
                sweep(elements, e, &self.rotation, self.n, &place, &mut self.bits, &mut self.trail);
            }
            self.masks.end_layer(&mut self.layer_fill, &mut self.trail);
        }
        self.sum_elements(elements);
        self.filled_weight += buried as f32 / (self.n * self.n) as f32;
        self.holes.clear();
        self.traced.clear();
        let texels = (self.n * self.n) as f32;
        let filled = self.masks.count(&self.masks.fill) as f32 / texels;
        let unknown = self.masks.count(&self.masks.unknown) as f32 / texels;
        Shares { filled, unknown, holes: 1.0 - filled }
    }

    fn place(&mut self, record: &Record, p: Vec3A, n: Vec3A) {
        let frame = record.frame();
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

    /// Sets the bits of one element and finds its weight.
    fn fill_element(&mut self, elements: &Elements, e: usize, place: &[Vec2; 4], settings: &Settings) {
        let above = (0..4).all(|k| self.z[k][e] >= 0.0);
        let mut clipped = [Vec2::ZERO; MAX_CLIPPED];
        let polygon = if above { place } else { self.above_horizon(elements, e, place, &mut clipped) };
        let area = signed_area(polygon);
        let rows = match settings.coverage {
            Coverage::Quad => polygon_rows(polygon, self.n, &mut self.bits),
            Coverage::Rectangle => rectangle_rows(polygon, self.n, &mut self.bits),
        };
        // An area that is not a number fills nothing either.
        let fills = area > 0.0 && !elements.view_dependent[e];
        if !fills {
            for j in rows {
                self.trail[j] |= self.bits[j];
            }
            return;
        }
        let owner = u16::try_from(e).expect("at most 64 x 64 elements");
        let (mut taken, mut covered) = (0, 0);
        for j in rows {
            let bits = self.bits[j];
            let open = bits & !self.masks.closed(j);
            // Where two elements of a layer meet on a texel, the first keeps it.
            let fresh = open & !self.layer_fill[j];
            self.layer_fill[j] |= open;
            taken += open.count_ones();
            covered += bits.count_ones();
            own(&mut self.owner[j * self.n..], fresh, owner);
        }
        if taken != 0 {
            self.weight[e] = match settings.weights {
                AreaWeights::Analytic if taken == covered => area,
                AreaWeights::Analytic => area * taken as f32 / covered as f32,
                AreaWeights::Bits => taken as f32 / (self.n * self.n) as f32,
            };
        }
    }

    /// The part above the horizon of an element with a corner below it.
    #[cold]
    fn above_horizon<'a>(
        &self,
        elements: &Elements,
        e: usize,
        place: &'a [Vec2; 4],
        clipped: &'a mut [Vec2; MAX_CLIPPED],
    ) -> &'a [Vec2] {
        let space: [Vec3A; 4] =
            std::array::from_fn(|k| self.rotation * (elements.corner(e, k) - self.offset * elements.finite[e]));
        let below = |corner: &Vec3A| corner.z < -HORIZON * corner.length();
        match space.iter().filter(|corner| below(corner)).count() {
            0 => place,
            4 => &[],
            _ => {
                let corners = clip_at_horizon(&space, clipped);
                &clipped[..corners]
            }
        }
    }

    /// Sums radiance by shares in 16 lanes, element e in lane e mod 16, and adds the lanes in order: the same for every kernel.
    fn sum_elements(&mut self, elements: &Elements) {
        // Weight, then red, green, blue from a distance, then the same from infinity.
        let mut sums = [[0.0f32; LANES]; 7];
        let [red, green, blue] = elements.radiance.each_ref().map(|channel| channel.as_chunks::<LANES>().0);
        let weights = self.weight.as_chunks::<LANES>().0;
        let shares = elements.background_share.as_chunks::<LANES>().0;
        for ((((weight, share), red), green), blue) in weights.iter().zip(shares).zip(red).zip(green).zip(blue) {
            for lane in 0..LANES {
                let far = weight[lane] * share[lane];
                let near = weight[lane] - far;
                sums[0][lane] += weight[lane];
                for (channel, radiance) in [red, green, blue].into_iter().enumerate() {
                    sums[1 + channel][lane] += near * radiance[lane];
                    sums[4 + channel][lane] += far * radiance[lane];
                }
            }
        }
        let [weight, near @ .., _, _, _] = sums.map(|lanes| lanes.into_iter().sum::<f32>());
        let [.., r, g, b] = sums.map(|lanes| lanes.into_iter().sum::<f32>());
        self.filled_sum = [Vec3::from_array(near), Vec3::new(r, g, b)];
        self.filled_weight = weight;
    }
}

/// Gives the texels of a row whose bits are set to an element. In runs of a fixed length without a branch on the bits.
#[inline]
fn own(row: &mut [u16], mut bits: u64, owner: u16) {
    while bits != 0 {
        let first = bits.trailing_zeros() as usize;
        let run = row[first..].first_chunk_mut::<RUN>().expect("owners have room for a run after the last texel");
        let set = bits >> first;
        for (k, texel) in run.iter_mut().enumerate() {
            let taken = (set & (1 << k)) != 0;
            *texel = if taken { owner } else { *texel };
        }
        bits &= u64::MAX.checked_shl(u32::try_from(first + RUN).expect("at most 71")).unwrap_or(0);
    }
}
