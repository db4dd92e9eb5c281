//! Random numbers with a fixed seed, shared by the tests.

use hemimap::glam::{DVec2, DVec3, Vec2};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1), 24 bits, so that it is exact in both float types.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    pub(crate) fn square(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }

    pub(crate) fn square_f64(&mut self) -> DVec2 {
        let unit = |bits: u64| (bits >> 11) as f64 / (1_u64 << 53) as f64;
        DVec2::new(unit(self.bits()), unit(self.bits()))
    }

    /// Uniform on the sphere, by rejection.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let v = 2.0 * self.square_f64().extend(f64::from(self.unit())) - 1.0;
            if (1e-4..=1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}
