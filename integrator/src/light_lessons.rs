//! What samples of lights find at a point, for who learns which lights reach a place before it chooses among them: the
//! picture by its tiles, cells for what gather rays meet, paths for their vertices.

use glam::Vec2;
use scene::{LightDirection, LightLesson, Lights, Lobes, Scene};

use crate::sampler::Sampler;
use crate::secondary::{Shading, lights_of, unshadowed};
use crate::sky::SkySplit;
use crate::statistics::RayCounts;
use crate::terms::behind_glass::LampBehind;

/// Light samples of a point that learns.
const LIGHT_SAMPLES: u32 = 8;
/// Of few lights, one of so many samples takes any, however little it may bring: beside a sun that is a million times
/// as strong a lamp would have no lesson otherwise, and where a roof hides the sun there would be no light at all.
const ANY_EVERY: u32 = 4;
/// Most lights that are few. Of more, a place learns too little of each.
const MOST_FEW: u32 = 256;

/// How many lights there are, if they are so few that all of them are tried.
pub(crate) fn few(lights: &Lights) -> Option<u32> {
    u32::try_from(lights.count()).ok().filter(|&count| count <= MOST_FEW)
}

/// What light samples find at a point, as if each were chosen by what it may bring alone. Gloss finds lamps behind
/// glass, too, if it `looks_on`.
pub(crate) fn lessons<'a>(
    scene: &'a Scene,
    sky: Option<&'a SkySplit>,
    shading: &'a Shading,
    looks_on: bool,
    sampler: &mut Sampler,
    rays: &'a mut RayCounts,
) -> impl Iterator<Item = LightLesson> + 'a {
    let all = lights_of(scene, shading, sky);
    let mut lights = all.seen_from(shading.surface.p, shading.surface.n);
    let few = few(all);
    let even = 1.0 / all.count() as f32;
    let any_share = if few.is_some() { 1.0 / ANY_EVERY as f32 } else { 0.0 };
    (0..).zip(sampler.split_into(LIGHT_SAMPLES)).filter_map(move |(number, mut sampler)| {
        let [u_choice, u, v, u_any] = sampler.next_4d();
        let (light, probability) = if let Some(count) = few.filter(|_| number % ANY_EVERY == 0) {
            let light = hemimap::texel_index(u_any, count) as usize;
            (light, lights.probability(light))
        } else {
            lights.choose(u_choice)?
        };
        let chosen = probability + (even - probability) * any_share;
        let count = probability / chosen;
        if count == 0.0 {
            return None;
        }
        let direction = lights.direction_to_one(light, probability, Vec2::new(u, v));
        let value = direction.map_or(0.0, |direction| {
            let is_behind = |rays: &mut RayCounts| {
                let mut lamp = || LampBehind::new(scene, &shading.surface, direction.wi(), &lights, rays);
                looks_on && lamp().is_some_and(|lamp| lamp.light == light)
            };
            value(scene, sky, shading, &direction, is_behind, rays)
        });
        let moment = count * value * value;
        moment.is_finite().then_some(LightLesson { light, samples: 1.0, count, moment })
    })
}

/// What a light sample counts, whose lamp may be behind glass if it is hidden.
fn value(
    scene: &Scene,
    sky: Option<&SkySplit>,
    shading: &Shading,
    direction: &LightDirection<'_>,
    is_behind_glass: impl FnOnce(&mut RayCounts) -> bool,
    rays: &mut RayCounts,
) -> f32 {
    let wi = shading.frame.to_local(direction.wi());
    if wi.z <= 0.0 || !shading.leaves(direction.wi(), wi) {
        return 0.0;
    }
    rays.shadow += 1;
    let is_hidden = scene.occluded(&shading.surface.shadow_ray(direction.wi(), direction.distance()));
    if is_hidden && !is_behind_glass(rays) {
        return 0.0;
    }
    let Some(sample) = direction.sample() else { return 0.0 };
    let lobes = if is_hidden { Lobes::SPECULAR } else { Lobes::ALL };
    unshadowed(&shading.bsdf, lobes, shading.wo, wi, &sample, sky).max_element()
}
