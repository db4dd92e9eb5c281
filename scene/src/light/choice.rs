//! A choice among many by weight.

/// Probabilities and their sums, for inversion: neighbouring numbers choose neighbouring lights, which keeps stratified
/// numbers stratified.
#[derive(Debug, Clone, Default)]
pub(super) struct Choice {
    /// Sum of the weights up to and including each; f64, for 10^6 equal weights would be unequal in f32.
    sums: Vec<f64>,
}

impl Choice {
    /// Makes a choice in proportion to finite weights, none of them negative.
    pub(super) fn new(weights: impl Iterator<Item = f64>) -> Self {
        let mut sum = 0.0;
        let sums: Vec<f64> = weights
            .map(|weight| {
                sum += weight;
                sum
            })
            .collect();
        if sum > 0.0 { Self { sums: sums.into_iter().map(|s| s / sum).collect() } } else { Self::default() }
    }

    /// Whether there is nothing to choose: no weight above 0.
    pub(super) fn is_empty(&self) -> bool {
        self.sums.is_empty()
    }

    /// Returns the probability of each and all before it.
    pub(super) fn ends(&self) -> &[f64] {
        &self.sums
    }

    /// Returns the one that `u` in [0, 1) chooses, and its probability.
    #[inline]
    pub(super) fn sample(&self, u: f64) -> Option<(usize, f32)> {
        // The same as below for a quarter of the instructions, in the scenes that are used most.
        if self.sums.len() == 1 {
            return Some((0, 1.0));
        }
        let index = self.sums.partition_point(|&sum| sum <= u);
        (index < self.sums.len()).then(|| (index, self.probability(index)))
    }

    /// Returns the probability of one.
    #[inline]
    pub(super) fn probability(&self, index: usize) -> f32 {
        if self.sums.is_empty() {
            return 0.0;
        }
        let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
        #[expect(clippy::cast_possible_truncation, reason = "a probability, rounded to f32")]
        let probability = (self.sums[index] - before) as f32;
        probability
    }

    /// Returns what is left of the number `u` that chose `index`: uniform in [0, 1] again, with as many digits less as
    /// the choice took.
    #[inline]
    pub(super) fn rest(&self, u: f32, index: usize) -> f32 {
        let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
        #[expect(clippy::cast_possible_truncation, reason = "a share, rounded to f32")]
        let rest = ((f64::from(u) - before) / (self.sums[index] - before)) as f32;
        rest.clamp(0.0, 1.0)
    }

    /// Returns the memory held, bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.sums.capacity() * size_of::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_in_proportion_to_weight() {
        let choice = Choice::new([0.0, 1.0, 0.0, 3.0, 0.0].into_iter());
        assert_eq!(choice.sample(0.0), Some((1, 0.25)), "the first with a weight");
        assert_eq!(choice.sample(0.2499), Some((1, 0.25)), "up to a quarter");
        assert_eq!(choice.sample(0.25), Some((3, 0.75)), "from a quarter");
        assert_eq!(choice.sample(1.0 - f64::EPSILON / 2.0), Some((3, 0.75)), "the last with a weight");
        assert_eq!(choice.probability(2), 0.0, "no weight, no probability");
        assert_eq!(
            (choice.rest(0.125, 1), choice.rest(0.25, 3)),
            (0.5, 0.0),
            "halfway through the first, at the start of the second"
        );
    }

    #[test]
    fn nothing_is_chosen_among_nothing() {
        for weights in [&[][..], &[0.0, 0.0]] {
            let choice = Choice::new(weights.iter().copied());
            assert!(choice.is_empty() && choice.sample(0.5).is_none(), "{weights:?}");
        }
    }
}
