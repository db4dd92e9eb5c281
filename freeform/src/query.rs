//! Rays against solids: nearest hit, any hit, and all stretches inside.
//!
//! Units of the solid (see `plan`) are asked in the order in which the ray enters their boxes, and only when the walk
//! has come so far. Their crossings are taken in order; each changes the counts of the operations above it, and where
//! the side of the whole changes there is a crossing of the solid. Faces that rounding cannot tell apart are crossed
//! together, so that what touches hangs together and what was taken away leaves no skin.

use std::ops::ControlFlow;

use crate::{
    Crossing, Interval, Ray, Solid, blend,
    buffer::Buffer,
    interval::touching_gap,
    plan::{Plan, Unit},
    trace::{Walked, walk},
};

/// Lists of so many units, crossings or operations need no heap.
const FEW: usize = 16;

/// A unit whose box the ray meets.
#[derive(Debug, Clone, Copy)]
struct Met {
    near: f64,
    unit: u32,
}

impl Solid {
    /// Returns the first crossing of the surface with `t_min < t < t_max`.
    ///
    /// A ray that starts on the surface, within the rounding of its origin and of the form's size, does not cross it
    /// there: entering, its first crossing is the exit; leaving, the next entry. A hit of a ray from more than a few
    /// times that size away, or on a form without end, may have more rounding than that: step it onto the surface, by
    /// `-value / |gradient|^2` times the gradient, before it is a start. Touches (double roots) are no crossings; nor
    /// is a stretch of zero length.
    pub fn first_hit(&self, ray: &Ray) -> Option<Crossing> {
        let mut first = None;
        if self.plan.is_union
            && let Ok(crossing) = self.first_of_union(ray)
        {
            return crossing;
        }
        self.walk(ray, |crossing| {
            first = Some(crossing);
            ControlFlow::Break(())
        });
        first
    }

    /// Says whether the ray crosses the surface with `t_min < t < t_max`: whether there is a [`Solid::first_hit`],
    /// which it takes as long as.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.first_hit(ray).is_some()
    }

    /// Replaces the contents of `out` by the stretches of the ray inside the solid, in order and apart from each other;
    /// stretches of zero length are left out.
    pub fn intervals(&self, ray: &Ray, out: &mut Vec<Interval>) {
        out.clear();
        let mut open = None;
        let walked = self.walk(ray, |Crossing { t, entering, .. }| {
            if entering {
                open = Some(t);
            } else {
                let t_in = open.take().unwrap_or(ray.t_min);
                if t_in < t {
                    out.push(Interval { t_in, t_out: t });
                }
            }
            ControlFlow::Continue(())
        });
        if walked.ends_inside {
            out.push(Interval { t_in: open.unwrap_or(ray.t_min), t_out: ray.t_max });
        }
    }

    /// Shows each crossing of the ray with the surface to `visit`, in order, until that breaks off.
    fn walk(&self, ray: &Ray, visit: impl FnMut(Crossing) -> ControlFlow<()>) -> Walked {
        if self.plan.nodes.is_empty() { self.walk_unit(0, ray, visit) } else { Sweep::new(self, ray).run(visit) }
    }

    fn walk_unit(&self, unit: u32, ray: &Ray, mut visit: impl FnMut(Crossing) -> ControlFlow<()>) -> Walked {
        let visit = |crossing| visit(Crossing { part: unit, ..crossing });
        let Unit { place, .. } = self.plan.units[unit as usize];
        match self.plan.cells(unit, &self.tokens, &self.forms) {
            None => walk(&self.forms[place.form], ray, visit),
            Some(cells) => blend::walk(self, place, (self.plan.boxes.extent(unit), cells), ray, visit),
        }
    }

    /// Returns the units whose boxes the ray meets, in order.
    fn met(&self, ray: &Ray) -> Buffer<Met, FEW> {
        let mut met = Buffer::new(Met { near: 0.0, unit: 0 });
        if ray.is_sound() {
            let boxes = &self.plan.boxes;
            boxes.along(ray.origin, ray.direction, ray.t_min, ray.t_max, |unit, near| met.push(Met { near, unit }));
            met.entries_mut().sort_unstable_by(|a, b| a.near.total_cmp(&b.near).then(a.unit.cmp(&b.unit)));
        }
        met
    }

    /// Returns the first crossing of a union of units with a ray that starts outside of all: the first entry to any.
    /// Units beyond it are left out.
    fn first_of_union(&self, ray: &Ray) -> Result<Option<Crossing>, StartsInside> {
        let mut nearest: Option<Crossing> = None;
        for &Met { near, unit } in self.met(ray).entries() {
            if nearest.is_some_and(|crossing| near > crossing.t) {
                break;
            }
            let mut first = None;
            let walked = self.walk_unit(unit, ray, |crossing| {
                first = Some(crossing);
                ControlFlow::Break(())
            });
            if walked.starts_inside {
                return Err(StartsInside);
            }
            nearest = match (nearest, first) {
                (Some(a), Some(b)) => Some(if b.t < a.t { b } else { a }),
                (a, b) => a.or(b),
            };
        }
        Ok(nearest)
    }
}

/// The ray starts in one of the units.
struct StartsInside;

/// A walk along a ray through a tree.
struct Sweep<'a> {
    solid: &'a Solid,
    ray: &'a Ray,
    /// Ray parameter at which rounding of the origin shows.
    reach: f64,
    met: Buffer<Met, FEW>,
    /// How many of the units met have been asked.
    asked: usize,
    /// Crossings of the units to come, the next one last.
    events: Buffer<Crossing, FEW>,
    /// Parts that the ray is in, for each operation.
    counts: Buffer<i64, FEW>,
    inside: bool,
    now: f64,
}

impl<'a> Sweep<'a> {
    fn new(solid: &'a Solid, ray: &'a Ray) -> Self {
        let plan = &solid.plan;
        let mut counts = Buffer::new(0);
        plan.rest.iter().for_each(|&count| counts.push(count));
        Self {
            solid,
            ray,
            reach: (ray.origin.length_squared() / ray.direction.length_squared()).sqrt(),
            met: solid.met(ray),
            asked: 0,
            events: Buffer::new(Crossing { t: 0.0, entering: false, part: 0 }),
            counts,
            inside: plan.rests_inside() && ray.is_sound(),
            now: ray.t_min,
        }
    }

    fn run(mut self, mut visit: impl FnMut(Crossing) -> ControlFlow<()>) -> Walked {
        self.ask_up_to(self.ray.t_min);
        let starts_inside = self.inside;
        let mut told = starts_inside;
        while let Some(t) = self.next() {
            // What lay behind the start of an endless ray is at minus infinity.
            let end = if t.is_finite() { t + touching_gap(t, self.reach) } else { t };
            let mut last = None;
            while self.next().is_some_and(|next| next <= end) {
                let Some(event) = self.events.pop() else { break };
                self.now = self.now.max(event.t);
                if self.change(event.part, event.entering) {
                    last = Some(Crossing { entering: self.inside, ..event });
                }
            }
            if let Some(crossing) = last.filter(|_| self.inside != told) {
                told = self.inside;
                if visit(crossing).is_break() {
                    break;
                }
            }
        }
        Walked { starts_inside, ends_inside: told }
    }

    /// Returns where the next crossing of a unit is, after asking all units that may have it.
    fn next(&mut self) -> Option<f64> {
        loop {
            let next = self.events.entries().last().map(|event| event.t);
            let Some(met) = self.met.entries().get(self.asked) else { return next };
            if next.is_some_and(|next| met.near > next) {
                return next;
            }
            let near = met.near;
            self.ask_up_to(near);
        }
    }

    /// Asks the units whose boxes begin at `near` or before.
    fn ask_up_to(&mut self, near: f64) {
        while let Some(&Met { near: begin, unit }) = self.met.entries().get(self.asked).filter(|met| met.near <= near) {
            self.asked += 1;
            let (events, now) = (&mut self.events, self.now);
            let is_less = |a: &Crossing, b: &Crossing| a.t < b.t;
            let walked = self.solid.walk_unit(unit, self.ray, |crossing| {
                // What lies behind did not matter then.
                events.insert_descending(Crossing { t: crossing.t.max(now), ..crossing }, is_less);
                ControlFlow::Continue(())
            });
            if walked.starts_inside {
                if begin <= self.ray.t_min {
                    self.change(unit, true);
                } else {
                    events.insert_descending(Crossing { t: now, entering: true, part: unit }, is_less);
                }
            }
        }
    }

    /// Takes note that the ray is in a unit from here on, or is no longer. Returns whether the side of the whole
    /// changed.
    fn change(&mut self, unit: u32, entering: bool) -> bool {
        let Plan { units, nodes, .. } = &self.solid.plan;
        let unit = &units[unit as usize];
        let counts = self.counts.entries_mut();
        let (mut above, mut share, mut inside) = (unit.parent, unit.share, entering);
        while let Some(index) = above {
            let node = &nodes[index as usize];
            let count = &mut counts[index as usize];
            let before = node.is_inside(*count);
            *count += if inside { share } else { -share };
            let after = node.is_inside(*count);
            if before == after {
                return false;
            }
            (above, share, inside) = (node.parent, node.share, after);
        }
        self.inside = inside;
        true
    }
}
