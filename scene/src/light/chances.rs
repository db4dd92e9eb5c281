//! Which light is chosen for a point: by what each may bring there.
//!
//! ```text
//! E = L A min(1, (h + s) / d) / (d^2 + A / pi)       a flat lamp
//! E = (flux / 4 pi) / (d^2 + area / 4 pi)            a free form, or a point without area
//! E = (integral of L over the sphere) / 4            the surroundings
//! ```
//!
//! E is about the irradiance of a surface that is turned to the light, with nothing between. d is the distance to the
//! middle of the lamp, h the height over its plane, which is 0 or less where the lamp is not seen, and s a fifth of the
//! root of its area A: near a wide lamp not all of it is seen as its middle is. A disc over its middle, and an even
//! sky, are right. The normal of the surface is left out, so that a ray that meets a light by chance knows the density
//! by the point from which it came. Very many lamps are looked at in groups, branches of a tree that chooses one of
//! them then; E of a group is what the tree says of it. Among lights at infinity, which bring the same to all points,
//! flux chooses.
//!
//! By flux alone a lamp of 10 cm on a ground of 400 m under a night sky was chosen 3 times in 10^4, although it brought
//! most of the light: relMSE of `path` with 64 samples a pixel was 0.7, and is 4e-4.

use std::ops::Range;

use glam::Vec3A;

use super::choice::Choice;
use super::lamps::{LANES, Lamps, MOST_BLOCKS, MOST_GROUPS};
use super::tree::{Emitter, number};
use super::{Light, Lights, narrow};
use crate::PunctualLight;

/// Groups of more lamps than [`MOST_GROUPS`]: more take longer and find no better lamp.
const GROUPS_OF_MANY: usize = 24;

/// What the lights may bring to a point.
#[derive(Debug)]
pub(super) struct Chances<'a> {
    p: Vec3A,
    choice: &'a LightChoice,
    /// Irradiance by the lamps of each block, summed over the channels.
    blocks: [f32; MOST_BLOCKS],
    /// By all lamps.
    near: f32,
    /// By all lights.
    total: f32,
}

impl<'a> Chances<'a> {
    /// Looks at the lights from `p`. Out of the way of scenes of a single light.
    #[inline(never)]
    pub(super) fn new(choice: &'a LightChoice, p: Vec3A) -> Self {
        let blocks = choice.lamps.irradiance(p);
        let near = blocks.iter().sum();
        Self { p, choice, blocks, near, total: near + choice.far_irradiance }
    }

    /// Returns the light that `u` in [0, 1) chooses, and its probability; `None` where nothing shines to the point.
    #[inline(never)]
    pub(super) fn choose(&self, lights: &Lights, u: f32) -> Option<(usize, f32)> {
        let &Self { p, choice, near, total, .. } = self;
        // In f64 what is left of the number keeps its digits.
        let (mut along, lamps) = (f64::from(u) * f64::from(total), f64::from(near));
        if along >= lamps {
            let (index, probability) = choice.far.sample((along - lamps) / f64::from(total - near))?;
            return Some((lights.near_count + index, probability * ((total - near) / total)));
        }
        let block = pass(&self.blocks, &mut along)?;
        let irradiance = choice.lamps.irradiance_of(block, p);
        let lane = pass(&irradiance, &mut along)?;
        let (group, irradiance) = (LANES * block + lane, irradiance[lane]);
        let share = (along / f64::from(irradiance)).min(1.0 - f64::EPSILON);
        let (lamp, probability) = lights.tree.as_ref()?.sample(choice.nodes[group], p, share)?;
        Some((lamp, probability * (irradiance / total)))
    }

    /// Returns the probability with which [`Chances::choose`] takes a light.
    #[inline]
    pub(super) fn probability(&self, lights: &Lights, light: usize) -> f32 {
        let &Self { p, choice, near, total, .. } = self;
        if total <= 0.0 {
            return 0.0;
        }
        if light >= lights.near_count {
            return choice.far.probability(light - lights.near_count) * ((total - near) / total);
        }
        let Some(tree) = &lights.tree else { return 0.0 };
        let group = choice.group(tree.place(light));
        tree.probability(choice.nodes[group], p, light)
            * (choice.lamps.irradiance_of(group / LANES, p)[group % LANES] / total)
    }
}

/// Returns in which of some stretches, one after the other, a point is that lies so far `along` them, and takes from
/// that what is before; the last one where rounding left it behind.
#[inline]
fn pass(stretches: &[f32], along: &mut f64) -> Option<usize> {
    let mut last = None;
    for (number, stretch) in stretches.iter().map(|&stretch| f64::from(stretch)).enumerate() {
        if stretch > 0.0 {
            if let Some((_, before)) = last {
                *along -= before;
            }
            last = Some((number, stretch));
            if *along < stretch {
                break;
            }
        }
    }
    last.map(|(number, _)| number)
}

/// How lights are chosen: by what they may bring to a point, and by how much of it others like it have brought, where
/// that was learnt. [`Lights::learnt_choice`] makes one.
#[derive(Debug, Clone)]
pub struct LightChoice {
    /// Of the lights.
    count: usize,
    lamps: Lamps,
    /// Node of the tree for each group of lamps.
    nodes: Vec<usize>,
    /// Place of the first lamp of each group, in their order, and the group.
    starts: Vec<(u32, usize)>,
    /// Among the lights at infinity.
    pub(super) far: Choice,
    /// Irradiance that all of these bring to a surface that faces them, summed over the channels.
    far_irradiance: f32,
}

impl LightChoice {
    /// Among no lights.
    pub(super) fn empty() -> Self {
        Self {
            count: 0,
            lamps: Lamps::new(&[], &[]),
            nodes: Vec::new(),
            starts: Vec::new(),
            far: Choice::default(),
            far_irradiance: 0.0,
        }
    }

    /// Whether it may be one among these lights.
    #[inline]
    pub(super) fn is_of(&self, lights: &Lights) -> bool {
        self.count == lights.count()
    }

    /// The branches of the tree that are its groups, in the order of their lamps.
    pub(super) fn branches(&self) -> Vec<usize> {
        self.starts.iter().map(|&(_, group)| self.nodes[group]).collect()
    }

    /// By what lights may bring alone.
    pub(super) fn even(lights: &Lights) -> Self {
        Self::weighted(lights, &lights.branches(), |_| 1.0)
    }

    /// By the weights of lights in a stretch of places: of the branches of the tree, and of each light at infinity,
    /// whose places follow the others'.
    pub(super) fn weighted(lights: &Lights, branches: &[usize], weight: impl Fn(Range<u32>) -> f32) -> Self {
        let far: Vec<(f64, f64)> =
            lights.far_places().map(|place| (lights.far_flux(place), weight(one(place)).into())).collect();
        let flux: f64 = far.iter().map(|far| far.0).sum();
        let weighted: f64 = far.iter().map(|(flux, weight)| flux * weight).sum();
        let far_irradiance = if flux > 0.0 { narrow(lights.far_irradiance() * (weighted / flux)) } else { 0.0 };
        let far = Choice::new(far.into_iter().map(|(flux, weight)| flux * weight));
        let mut choice = Self { count: lights.count(), far, far_irradiance, ..Self::empty() };
        let Some(tree) = &lights.tree else { return choice };
        let (leaves, inner): (Vec<usize>, Vec<usize>) =
            branches.iter().partition(|&&branch| tree.node(branch).count == 1);
        let lamp = |&leaf: &usize| {
            let node = tree.node(leaf);
            let emitter = lights.light(node.child as usize).emitter();
            Emitter { flux: emitter.flux * weight(node.places()), ..emitter }
        };
        let branch = |&branch: &usize| {
            let node = tree.node(branch);
            node.weighted(weight(node.places()))
        };
        let (lamps, inner_nodes): (Vec<_>, Vec<_>) =
            (leaves.iter().map(lamp).collect(), inner.iter().map(branch).collect());
        choice.lamps = Lamps::new(&lamps, &inner_nodes);
        let from = leaves.len().next_multiple_of(LANES);
        let numbered = (0..).zip(&leaves).chain((from..).zip(&inner));
        choice.starts = numbered.map(|(group, &node)| (tree.node(node).places().start, group)).collect();
        choice.starts.sort_unstable();
        choice.nodes = leaves;
        // Lanes without a lamp are dark and never chosen.
        choice.nodes.resize(from, 0);
        choice.nodes.extend(inner);
        choice
    }

    /// Returns the group of the lamp at a place.
    #[inline]
    fn group(&self, place: u32) -> usize {
        self.starts[self.starts.partition_point(|start| start.0 <= place) - 1].1
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.lamps.memory_bytes()
            + self.nodes.capacity() * size_of::<usize>()
            + self.starts.capacity() * size_of::<(u32, usize)>()
            + self.far.memory_bytes()
    }
}

/// One place.
pub(super) fn one(place: usize) -> Range<u32> {
    number(place)..number(place + 1)
}

impl Lights {
    /// Returns the branches of the tree that are weighed for each point where nothing is known of them.
    fn branches(&self) -> Vec<usize> {
        let Some(tree) = &self.tree else { return Vec::new() };
        let mut branches = vec![0];
        let most = if self.near_count <= MOST_GROUPS { MOST_GROUPS } else { GROUPS_OF_MANY };
        tree.split(&mut branches, most, |node| (node.flux * node.shape.radius_sq.sqrt()).max(f32::MIN_POSITIVE));
        branches
    }

    /// Returns the places of the lights at infinity, which are their indices.
    pub(super) fn far_places(&self) -> Range<usize> {
        self.near_count..self.count()
    }

    /// Returns the place of a light: in the order of the tree, then of those at infinity.
    pub(super) fn place(&self, light: usize) -> u32 {
        match &self.tree {
            Some(tree) if light < self.near_count => tree.place(light),
            _ => {
                assert!(light < self.count(), "there is no light {light}");
                number(light)
            }
        }
    }

    /// Returns the flux of a light at infinity for each square metre of the cross-section of the scene, summed over the
    /// channels: finite where the flux is not.
    fn far_flux(&self, light: usize) -> f64 {
        match self.light(light) {
            Light::Punctual(PunctualLight::Directional { irradiance, .. }) => irradiance.as_dvec3().element_sum(),
            Light::Environment(light) => light.integral().as_dvec3().element_sum(),
            _ => unreachable!("a lamp is not at infinity"),
        }
    }

    /// Returns the irradiance that the lights at infinity bring to a surface that faces them, summed over the channels;
    /// of surroundings as if they were even.
    fn far_irradiance(&self) -> f64 {
        let share = |light| if matches!(self.light(light), Light::Environment(_)) { 0.25 } else { 1.0 };
        self.far_places().map(|light| share(light) * self.far_flux(light)).sum()
    }
}
