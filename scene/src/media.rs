//! The transparent bodies that a point lies in, and which of them is there where several overlap.
//!
//! Of overlapping bodies the one of the highest priority fills the place; the boundaries of weaker ones within it are
//! no boundaries: rays pass them straight and only remember that they did. So water may reach into the wall of its
//! glass, and the faces are air to glass, glass to water, water to air.
//!
//! A ray carries its bodies in four bytes. Scenes in which no body has a priority or absorbs number none of them: their
//! rays carry zeros and nobody asks for more.
//!
//! # Source
//! Schmidt, Budge 2002: Simple Nested Dielectrics in Ray Traced Images. Bodies of equal priority are not in their
//! scheme; here they stay what they are without priorities: each boundary has the ratio that its own index says.

use glam::Vec3;

use crate::{Material, SpecularKind};

/// The transparent bodies in which a point lies, by their numbers: 0 is none. Of more than four the weakest is
/// forgotten.
///
/// Rays outside of everything have [`Media::NONE`], and so have all in scenes where no body has a priority or absorbs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Media([u8; LAST + 1]);

const LAST: usize = 3;

impl Media {
    /// No body.
    pub const NONE: Self = Self([0; LAST + 1]);

    /// Whether there is none.
    #[inline]
    #[must_use]
    pub fn is_empty(self) -> bool {
        // Entered bodies stand in front.
        self.0[0] == 0
    }

    /// Returns the bodies beyond a boundary, where `front` says that the body is entered there. Of a body that was
    /// never entered nothing is left.
    pub(crate) fn beyond(mut self, medium: u8, front: bool) -> Self {
        if front {
            // A free slot is 0, and numbers rise with priorities: the first of the least is the free one or the
            // weakest.
            let (slot, least) = (0..).zip(self.0).min_by_key(|&(_, other)| other).unwrap_or_default();
            if least < medium {
                self.0[slot] = 0;
                let free = if least == 0 {
                    slot
                } else {
                    self.0[slot..].rotate_left(1);
                    LAST
                };
                self.0[free] = medium;
            }
        } else if let Some(slot) = self.0.iter().rposition(|&other| other == medium) {
            self.0[slot] = 0;
            self.0[slot..].rotate_left(1);
        }
        self
    }

    /// Returns them with one around them that was entered before; without it where there are four.
    pub(crate) fn within(mut self, medium: u8) -> Self {
        if self.0[LAST] == 0 {
            self.0.rotate_right(1);
            self.0[0] = medium;
        }
        self
    }

    pub(crate) fn contains(self, medium: u8) -> bool {
        self.0.contains(&medium)
    }

    /// Returns them from the first to the last entered.
    fn iter(self) -> impl Iterator<Item = u8> {
        self.0.into_iter().take_while(|&medium| medium != 0)
    }
}

/// What a transparent body is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Medium {
    ior: f32,
    pub(crate) absorption: Vec3,
    priority: i32,
}

/// Numbers and properties of the transparent bodies of a scene; empty where none has a priority or absorbs.
#[derive(Debug, Default)]
pub(crate) struct MediumTable {
    /// Number by material, 0 for what is not transparent; empty where no body has a priority or absorbs.
    numbers: Vec<u8>,
    /// By number less 1, in the order of their priorities.
    media: Vec<Medium>,
}

impl MediumTable {
    /// Most transparent materials that can be numbered.
    pub(crate) const MAX: usize = 255;

    /// Numbers the transparent materials where any has a priority, of which there are at most [`MediumTable::MAX`]
    /// then, or where one absorbs: what a ray meets within glass has lost light on its way. (More than so many
    /// materials without priorities stay without numbers, and only faces that a ray meets from within tell of a way
    /// through glass.)
    pub(crate) fn new(materials: &[Material]) -> Self {
        let medium = |material: &Material| match material.specular {
            SpecularKind::Dielectric { ior, absorption, priority, .. } => Some(Medium { ior, absorption, priority }),
            _ => None,
        };
        let mut media: Vec<(usize, Medium)> =
            materials.iter().enumerate().filter_map(|(i, material)| Some((i, medium(material)?))).collect();
        let has_priority = media.iter().any(|(_, medium)| medium.priority != 0);
        let absorbs = media.iter().any(|(_, medium)| medium.absorption != Vec3::ZERO);
        let are_numbered = has_priority || (absorbs && media.len() <= Self::MAX);
        if !are_numbered {
            return Self::default();
        }
        media.sort_by_key(|(_, medium)| medium.priority);
        let mut numbers = vec![0; materials.len()];
        for (number, (material, _)) in (1..=u8::MAX).zip(&media) {
            numbers[*material] = number;
        }
        Self { numbers, media: media.into_iter().map(|(_, medium)| medium).collect() }
    }

    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// Returns the number of a material.
    #[inline]
    pub(crate) fn number(&self, material: u32) -> u8 {
        self.numbers.get(material as usize).copied().unwrap_or(0)
    }

    fn medium(&self, number: u8) -> &Medium {
        &self.media[usize::from(number) - 1]
    }

    /// Returns what fills a place: of the bodies there the one of highest priority, of equal ones the last entered.
    pub(crate) fn filling(&self, media: Media) -> Option<&Medium> {
        media.iter().map(|number| self.medium(number)).max_by_key(|medium| medium.priority)
    }

    /// Whether a boundary of body `number` is none, for a stronger body is there.
    pub(crate) fn hides(&self, media: Media, number: u8) -> bool {
        self.filling(media).is_some_and(|filling| filling.priority > self.medium(number).priority)
    }

    /// Returns the bodies before a boundary. A back that was met belongs to a body in which the ray was, whether or not
    /// it saw itself enter.
    pub(crate) fn before(&self, media: Media, number: u8, front: bool) -> Media {
        if front || number == 0 || media.contains(number) { media } else { media.beyond(number, true) }
    }

    /// Returns the index beyond a boundary of body `number` over that before it.
    pub(crate) fn eta(&self, media: Media, number: u8, front: bool) -> f32 {
        let around = if front { media } else { media.beyond(number, false) };
        let own = self.medium(number);
        let outside = match self.filling(around) {
            Some(other) if other.priority < own.priority => other.ior,
            _ => 1.0,
        };
        if front { own.ior / outside } else { outside / own.ior }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glass(ior: f32, priority: i32) -> Material {
        let specular = SpecularKind::Dielectric { ior, tint: Vec3::ONE, absorption: Vec3::splat(ior), priority };
        Material { specular, ..Material::default() }
    }

    #[test]
    fn bodies_are_left_in_any_order() {
        let both = Media::NONE.beyond(3, true).beyond(1, true);
        assert_eq!(both.beyond(3, false), Media::NONE.beyond(1, true), "the first");
        assert_eq!(both.beyond(1, false), Media::NONE.beyond(3, true), "the last");
        assert_eq!(both.beyond(2, false), both, "one in which nobody was");
        assert!(both.beyond(1, false).beyond(3, false).is_empty(), "all");
        let twice = both.beyond(3, true).beyond(3, false);
        assert_eq!(twice.beyond(3, false), Media::NONE.beyond(1, true), "two bodies of one material");
    }

    #[test]
    fn of_five_bodies_the_weakest_is_forgotten() {
        let four = [4, 2, 5, 3].into_iter().fold(Media::NONE, |media, number| media.beyond(number, true));
        assert_eq!(four.beyond(6, true).iter().collect::<Vec<_>>(), [4, 5, 3, 6], "the 2 makes room");
        assert_eq!(four.beyond(1, true), four, "the 1 is weaker still");
        assert_eq!(four.beyond(2, false).beyond(1, true).iter().collect::<Vec<_>>(), [4, 5, 3, 1], "here was room");
        assert_eq!(four.within(6), four, "nor is there room around them");
        assert_eq!(Media::NONE.beyond(2, true).within(6).iter().collect::<Vec<_>>(), [6, 2], "here there was");
    }

    #[test]
    fn scenes_of_clear_glass_without_priorities_number_nothing() {
        let clear = |ior| {
            let specular = SpecularKind::Dielectric { ior, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
            Material { specular, ..Material::default() }
        };
        let table = MediumTable::new(&[clear(1.5), Material::default(), clear(1.33)]);
        assert!(table.is_empty() && table.number(0) == 0 && table.number(2) == 0, "nothing");
        let table = MediumTable::new(&[glass(1.5, 0), Material::default(), clear(1.33)]);
        assert_eq!([0, 1, 2].map(|material| table.number(material)), [1, 0, 2], "one absorbs");
        assert!(MediumTable::new(&vec![glass(1.5, 0); 300]).is_empty(), "too many");
        let table = MediumTable::new(&[glass(1.5, 1), Material::default(), glass(1.33, 0)]);
        assert_eq!([0, 1, 2, 3].map(|material| table.number(material)), [2, 0, 1, 0], "by priority");
    }

    #[test]
    fn boundaries_have_the_ratio_of_what_they_divide() {
        let table = MediumTable::new(&[glass(1.33, 0), glass(1.5, 2), glass(2.0, 0)]);
        let [water, glass, drop] = [0, 1, 2].map(|material| table.number(material));
        let in_water = Media::NONE.beyond(water, true);
        let in_both = in_water.beyond(glass, true);
        assert_eq!(table.eta(Media::NONE, glass, true), 1.5, "air to glass");
        assert_eq!(table.eta(in_water, glass, true), 1.5 / 1.33, "water to glass");
        assert_eq!(table.eta(in_both, glass, false), 1.33 / 1.5, "and back");
        assert!(table.hides(in_both, water) && !table.hides(in_water, glass), "glass is the stronger");
        assert_eq!(table.filling(in_both).map(|medium| medium.ior), Some(1.5), "so it fills the place");
        assert_eq!(table.eta(in_water, drop, true), 2.0, "of equal priority: by its own index");
        assert!(!table.hides(in_water, drop), "and none hides the other");
        assert_eq!(table.filling(in_water.beyond(drop, true)).map(|medium| medium.ior), Some(2.0), "the last entered");
    }
}
