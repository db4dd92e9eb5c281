//! Depth layers: buckets of distance on a logarithmic scale, so that the nearest are the thinnest (paper, section 5.2).

/// Gives each distance its layer, 0 the nearest, `layers - 1` the farthest, into `out`.
///
/// The last layer holds what is infinitely far, alone where there are at least two layers. The others divide the range
/// of the finite distances evenly in the logarithm, in O(distances) and without a logarithm of zero: what is nearer
/// than 1e-4 of the farthest shares the first layer.
///
/// # Panics
/// If `layers` is 0 or above 256, or the slices differ in length.
pub fn depth_layers(distances: &[f32], layers: usize, out: &mut [u8]) {
    assert!((1..=256).contains(&layers), "1 to 256 layers");
    assert_eq!(distances.len(), out.len(), "one layer for each distance");
    let finite = || distances.iter().copied().filter(|d| d.is_finite());
    let farthest = finite().fold(0.0, f32::max);
    /// Nearer than this share of the farthest, order no longer matters: a record so close to a surface serves nobody.
    const NEAREST_SHARE: f32 = 1e-4;
    let nearest = finite().fold(f32::INFINITY, f32::min).max(farthest * NEAREST_SHARE);
    let last = layers - 1;
    let span = (farthest / nearest).ln();
    let scale = if span > 0.0 && span.is_finite() { last as f32 / span } else { 0.0 };
    for (layer, &distance) in out.iter_mut().zip(distances) {
        let bucket = if distance.is_finite() {
            let position = (distance.max(nearest) / nearest).ln() * scale;
            #[expect(clippy::cast_possible_truncation, reason = "clamped to the layers; NaN becomes 0")]
            let bucket = position as usize;
            bucket.min(last.saturating_sub(1))
        } else {
            last
        };
        *layer = u8::try_from(bucket).expect("at most 256 layers");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn layers_take_every_distance(
            distances in prop::collection::vec(prop_oneof![
                Just(0.0), Just(1e-30), Just(1.0), Just(1e30), Just(f32::INFINITY), 0.0f32..100.0
            ], 1..40),
            layers in prop_oneof![Just(1usize), Just(2), Just(8), Just(64), Just(256)],
        ) {
            let mut out = vec![0; distances.len()];
            depth_layers(&distances, layers, &mut out);
            for (i, &a) in distances.iter().enumerate() {
                prop_assert!(usize::from(out[i]) < layers);
                if a.is_infinite() { prop_assert_eq!(usize::from(out[i]), layers - 1); }
                for (j, &b) in distances.iter().enumerate() {
                    if a <= b { prop_assert!(out[i] <= out[j], "monotone: {} {} -> {} {}", a, b, out[i], out[j]); }
                }
            }
        }
    }

    #[test]
    fn layers_are_even_in_the_logarithm() {
        let mut out = [0; 5];
        depth_layers(&[1.0, 2.1, 4.1, 8.0, f32::INFINITY], 4, &mut out);
        assert_eq!(out, [0, 1, 2, 2, 3], "a factor of two each, the farthest in the last finite one");
    }
}
