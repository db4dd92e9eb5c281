//! An oracle for crossings: plain numbers in, exact counts out. It shares no code with the crate.

pub(crate) mod dyadic;
pub(crate) mod exact;
pub(crate) mod interval;

use dyadic::Dyadic;

/// A free form as numbers.
#[derive(Debug, Clone)]
pub(crate) struct RawForm {
    pub(crate) base: [f64; 10],
    pub(crate) perturbations: Vec<([f64; 10], f64)>,
}

impl RawForm {
    /// Returns a copy in which `change` was applied to every coefficient and factor.
    pub(crate) fn changed(&self, mut change: impl FnMut(f64) -> f64) -> Self {
        Self {
            base: self.base.map(&mut change),
            perturbations: self.perturbations.iter().map(|(q, f)| (q.map(&mut change), change(*f))).collect(),
        }
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
