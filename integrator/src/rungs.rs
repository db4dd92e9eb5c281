//! Which rung of the ladder from interpolation to a gather each pixel has its indirect light from.

use reproject::{Parts, Shares};

/// How the surfaces of a pixel got their indirect light. Each number is a share of the pixel's samples: together
/// [`interpolated`](Self::interpolated), [`reprojected`](Self::reprojected) and [`gathered`](Self::gathered) are 1
/// where each sample ends at one surface that asks for such light, 0 where none does, as at lamps and the sky, and more
/// where glass splits them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rungs {
    /// Took their light from records of irradiance around them.
    pub interpolated: f32,
    /// Had a record of radiance reprojected to them.
    pub reprojected: f32,
    /// Looked for themselves.
    pub gathered: f32,
    /// The part of [`Self::reprojected`] that is the records' share of the hemispheres, weighted by the cosine.
    pub filled: f32,
    /// The part of [`Self::reprojected`] that is the share of the hemispheres of which the records could know nothing.
    pub unknown: f32,
    /// The part of [`Self::filled`] that records saw in the same direction by the same element; this and the next two
    /// are what the paper tells apart, see [`reproject::Parts`]. What opened is the rest of [`Self::reprojected`].
    pub unchanged: f32,
    /// The part that came from another direction before what records saw here.
    pub moved: f32,
    /// The part behind something that is gone from here.
    pub bared: f32,
}

impl Rungs {
    /// The names of its numbers, in the order of [`Self::to_array`].
    pub const NAMES: [&str; 8] =
        ["interpolated", "reprojected", "gathered", "filled", "unknown", "unchanged", "moved", "bared"];

    /// All numbers.
    #[must_use]
    pub fn to_array(self) -> [f32; 8] {
        let Self { interpolated, reprojected, gathered, filled, unknown, unchanged, moved, bared } = self;
        [interpolated, reprojected, gathered, filled, unknown, unchanged, moved, bared]
    }

    /// Adds a surface that has this share of the samples.
    pub(crate) fn add(&mut self, rung: Rung, share: f32) {
        match rung {
            Rung::Unasked => {}
            Rung::Interpolated => self.interpolated += share,
            Rung::Gathered => self.gathered += share,
            Rung::Reprojected(of_hemisphere) => {
                self.reprojected += share;
                let sums = [&mut self.filled, &mut self.unknown, &mut self.unchanged, &mut self.moved, &mut self.bared];
                for (sum, steps) in sums.into_iter().zip(of_hemisphere) {
                    *sum += share * f32::from(steps) / STEPS;
                }
            }
        }
    }

    /// Mixes those of another picture in, so that they are this `share` of the whole.
    pub(crate) fn mix(&mut self, other: Self, share: f32) {
        let (own, other) = (self.to_array(), other.to_array());
        let [interpolated, reprojected, gathered, filled, unknown, unchanged, moved, bared] =
            std::array::from_fn(|number| own[number] + (other[number] - own[number]) * share);
        *self = Self { interpolated, reprojected, gathered, filled, unknown, unchanged, moved, bared };
    }
}

/// Shares of the hemisphere are kept in so many steps: one is kept for every surface point.
const STEPS: f32 = 255.0;

/// How one surface point got its light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Rung {
    /// It has none of this kind.
    #[default]
    Unasked,
    Interpolated,
    /// From a record that filled such a share of the hemisphere, could know nothing of such a share, and of what it
    /// filled had such parts unchanged, moved and bared: in steps of 1/255.
    Reprojected([u8; 5]),
    Gathered,
}

impl Rung {
    /// Whether the point traced rays of its own, few or many.
    pub(crate) fn has_looked(self) -> bool {
        matches!(self, Self::Reprojected(_) | Self::Gathered)
    }

    pub(crate) fn reprojected(shares: &Shares, parts: &Parts) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "shares lie in [0, 1]")]
        let steps = |share: f32| (share * STEPS).round() as u8;
        Self::Reprojected([shares.filled, shares.unknown, parts.unchanged, parts.moved, parts.bared].map(steps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_mix() {
        let mut rungs = Rungs::default();
        rungs.add(Rung::Unasked, 0.25);
        rungs.add(Rung::Interpolated, 0.25);
        let parts = Parts { unchanged: 0.2, moved: 0.4, bared: 0.2, opened: 0.2 };
        rungs.add(Rung::reprojected(&Shares { filled: 0.8, unknown: 0.2, holes: 0.2 }, &parts), 0.5);
        let expected = [0.25, 0.5, 0.0, 0.4, 0.1, 0.1, 0.2, 0.1];
        assert_eq!(rungs.to_array(), expected, "shares of the pixel, of which the record has four fifths");
        rungs.mix(Rungs { gathered: 1.0, ..Rungs::default() }, 0.5);
        assert_eq!((rungs.gathered, rungs.reprojected, rungs.filled), (0.5, 0.25, 0.2), "half of each");
    }
}
