//! Bits that look random.

/// Returns bits that look random and depend on all of `bits` (the finaliser of SplitMix64, Steele, Lea, Flood 2014); 0
/// stays 0.
#[inline]
pub(crate) const fn mixed(bits: u64) -> u64 {
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// What SplitMix64 adds to its state before each number: 2^64 over the golden ratio.
pub(crate) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
