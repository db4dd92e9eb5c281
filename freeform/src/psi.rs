//! How the functions of two solids become that of their union (psi of eq. 4 of the paper, which leaves it open).
//!
//! An intersection is `-psi(-f, -g)` and a difference `-psi(-f, g)`, so that one psi serves all three.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::FormError;

/// How the functions f and g of two solids become that of their union (eq. 4).
///
/// The first two give the same set, the union itself, and the same surface; they differ in the values beside it. A
/// blend fills the seam.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Psi {
    /// `max(f, g)`: the gradient jumps where f = g.
    #[default]
    Maximum,
    /// `f + g + sqrt(f^2 + g^2)`: smooth except on the seam f = g = 0.
    RFunction,
    /// `max(f, g) + (width / 6) max(0, 1 - |f - g| / width)^3`: twice continuously differentiable.
    ///
    /// It is the maximum where f and g differ by `width` or more, and nowhere above it by more than `width / 6`. The
    /// width is in units of the functions: that of a ball of radius r falls by 2/r a metre at its surface
    /// ([`FreeForm::weighted`](crate::FreeForm::weighted) changes that).
    Blend {
        /// Largest difference of f and g that is blended; positive.
        width: f64,
    },
}

/// What psi makes of two values, and how much of each argument's change it passes on: both shares are 0 or more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Joined {
    pub(crate) value: f64,
    pub(crate) shares: [f64; 2],
}

impl Psi {
    /// Passes psi on if its width is one.
    pub(crate) fn checked(self) -> Result<Self, FormError> {
        match self {
            Self::Blend { width } if !(width > 0.0 && width.is_finite()) => {
                Err(FormError::OutOfRange("the width of a blend"))
            }
            _ => Ok(self),
        }
    }

    /// Whether it gives a set of its own instead of the union.
    pub(crate) fn blends(self) -> bool {
        matches!(self, Self::Blend { .. })
    }

    /// Returns the value of the union.
    pub(crate) fn value(self, f: f64, g: f64) -> f64 {
        match self {
            Self::Maximum => f.max(g),
            // The sum of two negative values cancels the root: the conjugate 2 f g / (f + g - root) does not.
            Self::RFunction if f + g < 0.0 => -2.0 * f * g / (f.hypot(g) - (f + g)),
            Self::RFunction => f + g + f.hypot(g),
            Self::Blend { width } => {
                let h = (1.0 - (f - g).abs() / width).max(0.0);
                f.max(g) + width / 6.0 * (h * h * h)
            }
        }
    }

    /// Returns the value of the union and the shares of both slopes in its slope.
    pub(crate) fn join(self, f: f64, g: f64) -> Joined {
        let value = self.value(f, g);
        let shares = match self {
            Self::Maximum if f >= g => [1.0, 0.0],
            Self::Maximum => [0.0, 1.0],
            Self::RFunction => {
                let root = f.hypot(g);
                // 1 + a / root, without its cancellation where a is negative.
                let share = |a: f64, b: f64| match () {
                    () if root == 0.0 => 1.0,
                    () if a < 0.0 => b * b / (root * (root - a)),
                    () => 1.0 + a / root,
                };
                [share(f, g), share(g, f)]
            }
            Self::Blend { width } => {
                let h = (1.0 - (f - g).abs() / width).max(0.0);
                let less = 0.5 * h * h;
                if f >= g { [1.0 - less, less] } else { [less, 1.0 - less] }
            }
        };
        Joined { value, shares }
    }

    /// Returns how far below zero every part must be, at least, for the union of `parts` to be below `-depth`: the
    /// bound that boxes need.
    pub(crate) fn depth_below(self, depth: f64, parts: usize) -> f64 {
        match self {
            Self::Maximum => depth,
            // With both arguments at m < 0 the function is (2 - sqrt 2) m: nowhere is it a smaller share of the larger
            // argument.
            Self::RFunction if depth == 0.0 => 0.0,
            Self::RFunction => (1..parts).fold(depth, |depth, _| depth * 1.71),
            Self::Blend { width } => (1..parts).fold(depth, |depth, _| depth + width / 6.0 * (1.0 + 1e-12)),
        }
    }
}

/// What a tree of solids is evaluated in: numbers, with their slopes, or ranges of them.
pub(crate) trait Valued: Copy {
    /// Returns the value of the union of two.
    fn union(psi: Psi, f: Self, g: Self) -> Self;
    /// Returns the value of the complement.
    fn complement(self) -> Self;
}

impl Valued for f64 {
    fn union(psi: Psi, f: Self, g: Self) -> Self {
        psi.value(f, g)
    }

    fn complement(self) -> Self {
        -self
    }
}

/// A function near a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalLinear {
    pub(crate) value: f64,
    pub(crate) gradient: DVec3,
    /// Size of the terms that the gradient was summed from.
    pub(crate) weight: f64,
}

impl Valued for LocalLinear {
    fn union(psi: Psi, f: Self, g: Self) -> Self {
        let Joined { value, shares: [a, b] } = psi.join(f.value, g.value);
        Self { value, gradient: a * f.gradient + b * g.gradient, weight: a * f.weight + b * g.weight }
    }

    fn complement(self) -> Self {
        Self { value: -self.value, gradient: -self.gradient, ..self }
    }
}

/// A function of the ray parameter and its derivative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slope {
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

impl Valued for Slope {
    fn union(psi: Psi, f: Self, g: Self) -> Self {
        let Joined { value, shares: [a, b] } = psi.join(f.value, g.value);
        Self { value, slope: a * f.slope + b * g.slope }
    }

    fn complement(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Psi; 3] = [Psi::Maximum, Psi::RFunction, Psi::Blend { width: 0.5 }];

    #[test]
    fn shares_are_the_slopes_of_the_value() {
        for psi in ALL {
            for (f, g) in [(0.3, -0.2), (-0.4, -0.1), (0.2, 0.25), (-1.0, 2.0), (-0.3, -0.31)] {
                let Joined { value, shares } = psi.join(f, g);
                assert_eq!(value, psi.value(f, g), "{psi:?}: one value");
                let h = 1e-6;
                let by_f = (psi.value(f + h, g) - psi.value(f - h, g)) / (2.0 * h);
                let by_g = (psi.value(f, g + h) - psi.value(f, g - h)) / (2.0 * h);
                assert!((by_f - shares[0]).abs() < 1e-8, "{psi:?} at {f} {g}: {by_f} and {shares:?}");
                assert!((by_g - shares[1]).abs() < 1e-8, "{psi:?} at {f} {g}: {by_g} and {shares:?}");
            }
        }
    }

    #[test]
    fn a_blend_stays_inside_its_width() {
        let width = 0.4;
        let psi = Psi::Blend { width };
        for k in -40..=40 {
            for j in -40..=40 {
                let (f, g) = (f64::from(k) * 0.03, f64::from(j) * 0.03);
                let more = psi.value(f, g) - f.max(g);
                assert!((0.0..=width / 6.0 + 1e-15).contains(&more), "{more} more at {f} {g}");
                assert_eq!(more == 0.0, (f - g).abs() >= width, "blended just within the width: {f} {g}");
            }
        }
        // The second derivative of max + (w/6) (1 - |d|/w)^3 by d is h / w from both sides.
        let (f, h) = (0.1, 1e-4);
        let turn = |g: f64| (psi.value(f, g + h) - 2.0 * psi.value(f, g) + psi.value(f, g - h)) / (h * h);
        assert!((turn(f) - 1.0 / width).abs() < 1e-3, "curved, not creased, where f = g: {}", turn(f));
        assert!(turn(f + width).abs() < 1e-3, "and flat at the width: {}", turn(f + width));
    }

    #[test]
    fn what_is_deep_below_in_every_part_is_below_in_the_union() {
        for psi in ALL {
            for depth in [0.0, 0.01, 1.0] {
                let below = psi.depth_below(depth, 3);
                for k in 0..50 {
                    for j in 0..50 {
                        let deeper = |k: i32| -below - f64::from(k * k) * 0.01 - 1e-9;
                        let (f, g, h) = (deeper(k), deeper(j), deeper(0));
                        let value = psi.value(psi.value(f, g), h);
                        assert!(value < -depth + 1e-9 * (depth == 0.0) as i32 as f64, "{psi:?}: {value} for {depth}");
                    }
                }
            }
        }
    }
}
