//! What the samples of a surface point tell of its direct light.

use glam::Vec3;

/// The direct light of the samples of a surface point by which it may be fitted: that of the diffuse lobe, where there
/// is no other that light samples meet.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lit {
    /// Sum over the samples.
    pub(crate) sum: Vec3,
    /// The same of the first half of them, and of the albedo there; and their number.
    first: Vec3,
    first_weight: Vec3,
    first_count: f32,
    /// Whether something of it was sampled, and not known in closed form.
    pub(super) is_sampled: bool,
}

impl Lit {
    /// The direct light of one sample, which is in the first half of them or not.
    pub(crate) fn new(direct: Vec3, diffuse_weight: Vec3, is_first: bool, is_sampled: bool) -> Self {
        let whole = Self { sum: direct, is_sampled, ..Self::default() };
        if is_first { Self { first: direct, first_weight: diffuse_weight, first_count: 1.0, ..whole } } else { whole }
    }

    /// Adds another sample of the same surface.
    pub(crate) fn join(&mut self, sample: &Self) {
        self.sum += sample.sum;
        self.first += sample.first;
        self.first_weight += sample.first_weight;
        self.first_count += sample.first_count;
        self.is_sampled |= sample.is_sampled;
    }

    /// Takes all samples up to now for a part of the first half, as at least as many are to come.
    pub(crate) fn expect_more(&mut self, diffuse_weight: Vec3, count: f32) {
        (self.first, self.first_weight, self.first_count) = (self.sum, diffuse_weight, count);
    }

    /// The variance of direct light over albedo of a point of so many samples, by its halves. That of stratified samples
    /// is less: if it falls with the power 3/2 of their number, by 1.8 times. `None` where one of them is empty.
    pub(super) fn variance(&self, diffuse_weight: Vec3, count: f32) -> Option<Vec3> {
        let (rest_weight, rest_count) = (diffuse_weight - self.first_weight, count - self.first_count);
        let is_known = self.first_weight.min_element() > 0.0 && rest_weight.min_element() > 0.0 && rest_count > 0.0;
        let apart = self.first / self.first_weight - (self.sum - self.first) / rest_weight;
        is_known.then(|| apart * apart * (self.first_count * rest_count / (count * count)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_tell_the_variance_of_the_whole() {
        // Light over an albedo of 1/2: 2 in the first half, 4 in the other one, of as many samples.
        let sample = |light: f32, first| Lit::new(Vec3::splat(light), Vec3::splat(0.5), first, true);
        let mut lit = sample(1.0, true);
        lit.join(&sample(2.0, false));
        assert_eq!(lit.variance(Vec3::ONE, 2.0), Some(Vec3::ONE));
        // Both become the first half of four.
        lit.expect_more(Vec3::ONE, 2.0);
        assert_eq!(lit.variance(Vec3::ONE, 2.0), None, "of nothing else yet");
        lit.join(&sample(3.0, false));
        lit.join(&sample(3.0, false));
        assert_eq!((lit.sum.x, lit.variance(Vec3::splat(2.0), 4.0)), (9.0, Some(Vec3::splat(2.25))));
    }
}
