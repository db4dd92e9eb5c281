//! An oracle for crossings: plain numbers in, exact counts out. It shares no code with the crate.

pub(crate) mod blend;
pub(crate) mod dyadic;
pub(crate) mod exact;
pub(crate) mod interval;
pub(crate) mod tree;

use dyadic::Dyadic;

/// A free form as numbers.
#[derive(Debug, Clone)]
pub(crate) struct RawForm {
    pub(crate) base: [f64; 10],
    pub(crate) perturbations: Vec<([f64; 10], f64)>,
}

impl RawForm {
    /// Returns a copy to every coefficient and factor of which a share of it is added; to a coefficient of 0, of the
    /// largest.
    pub(crate) fn changed(&self, mut share: impl FnMut() -> f64) -> Self {
        let mut quadric = |q: &[f64; 10]| {
            let largest = q.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
            q.map(|c| c + share() * if c == 0.0 { largest } else { c })
        };
        let base = quadric(&self.base);
        let perturbations: Vec<_> = self.perturbations.iter().map(|(q, f)| (quadric(q), *f)).collect();
        let perturbations = perturbations.into_iter().map(|(q, f)| (q, f + share() * f)).collect();
        Self { base, perturbations }
    }
}

/// A ray as numbers; infinite ends are taken at 2^300.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawRay {
    pub(crate) origin: [f64; 3],
    pub(crate) direction: [f64; 3],
    pub(crate) t_min: f64,
    pub(crate) t_max: f64,
}

impl RawRay {
    pub(crate) fn lo(&self) -> Dyadic {
        if self.t_min.is_finite() { Dyadic::from(self.t_min) } else { &Dyadic::zero() - &Dyadic::power_of_two(300) }
    }

    pub(crate) fn hi(&self) -> Dyadic {
        if self.t_max.is_finite() { Dyadic::from(self.t_max) } else { Dyadic::power_of_two(300) }
    }
}

/// Crossings of a ray and the sides of its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counted {
    pub(crate) crossings: i32,
    pub(crate) starts_inside: bool,
    pub(crate) ends_inside: bool,
}
