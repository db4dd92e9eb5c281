//! Rays against solids: nearest hit, any hit, and all stretches inside.

use std::ops::ControlFlow;

use crate::{
    Crossing, Interval, Ray, Solid,
    interval::{merge, touching_gap},
    solid::Union,
    trace::walk,
};

/// The beginning of a ray: on which side it starts, and its first crossing.
#[derive(Debug, Clone, Copy)]
struct Beginning {
    starts_inside: bool,
    crossing: Option<Crossing>,
}

impl Solid {
    /// Returns the first crossing of the surface with `t_min < t < t_max`.
    ///
    /// A ray that starts on the surface, within the rounding of its origin, does not cross it there: entering, its first crossing is the exit; leaving, the
    /// next entry. Touches (double roots) are no crossings; nor is a stretch of zero length.
    pub fn first_hit(&self, ray: &Ray) -> Option<Crossing> {
        self.beginning(ray).crossing
    }

    /// Says whether the ray crosses the surface with `t_min < t < t_max`: the same answer as `first_hit`, without the search for the nearest.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        match self {
            Self::Form(_) => self.first_hit(ray).is_some(),
            Self::Union(union) => union.any_hit(ray),
        }
    }

    /// Replaces the contents of `out` by the stretches of the ray inside the solid, in order and apart from each other; stretches of zero length are left out.
    pub fn intervals(&self, ray: &Ray, out: &mut Vec<Interval>) {
        out.clear();
        self.each_interval(ray, &mut |interval| {
            out.push(interval);
            ControlFlow::Continue(())
        });
        if matches!(self, Self::Union(_)) {
            merge(out, reach(ray));
        }
    }

    /// Says whether the ray meets the box of the solid.
    fn is_near(&self, ray: &Ray) -> bool {
        let extent = self.extent();
        ray.is_sound() && !extent.is_empty() && extent.clip(ray.origin, ray.direction, ray.t_min, ray.t_max).is_some()
    }

    /// Returns the side on which the ray starts and its first crossing.
    fn beginning(&self, ray: &Ray) -> Beginning {
        match self {
            Self::Form(form) => {
                let mut crossing = None;
                let walked = walk(form, ray, |found| {
                    crossing = Some(found);
                    ControlFlow::Break(())
                });
                Beginning { starts_inside: walked.starts_inside, crossing }
            }
            Self::Union(union) => union.beginning(ray),
        }
    }

    /// Shows the stretches inside each form to `visit`: in order within a form, form after form, until that breaks off a form.
    fn each_interval(&self, ray: &Ray, visit: &mut impl FnMut(Interval) -> ControlFlow<()>) {
        match self {
            Self::Form(form) => {
                let mut open = None;
                let mut stopped = false;
                let walked = walk(form, ray, |Crossing { t, entering }| {
                    if entering {
                        open = Some(t);
                        return ControlFlow::Continue(());
                    }
                    let t_in = open.take().unwrap_or(ray.t_min);
                    let flow = if t_in < t { visit(Interval { t_in, t_out: t }) } else { ControlFlow::Continue(()) };
                    stopped = flow.is_break();
                    flow
                });
                if walked.ends_inside && !stopped {
                    // What follows the last stretch is nothing, so it does not matter whether the visitor breaks off.
                    let _ = visit(Interval { t_in: open.unwrap_or(ray.t_min), t_out: ray.t_max });
                }
            }
            Self::Union(union) => {
                if self.is_near(ray) {
                    union.parts().iter().for_each(|part| part.each_interval(ray, visit));
                }
            }
        }
    }
}

impl Union {
    fn beginning(&self, ray: &Ray) -> Beginning {
        let mut nearest = Beginning { starts_inside: false, crossing: None };
        // Outside of all parts the first entry counts. Parts beyond it are left out; the ray itself is not cut, so that each part gives the same bits as alone.
        let mut ahead = *ray;
        for part in self.parts() {
            if !part.is_near(&ahead) {
                continue;
            }
            let begin = part.beginning(ray);
            if begin.starts_inside {
                return Beginning { starts_inside: true, crossing: self.exit(ray) };
            }
            if let Some(crossing) = begin.crossing.filter(|crossing| crossing.t < ahead.t_max) {
                ahead.t_max = crossing.t;
                nearest.crossing = Some(crossing);
            }
        }
        nearest
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        let mut hit = false;
        for part in self.parts().iter().filter(|part| part.is_near(ray)) {
            let begin = part.beginning(ray);
            if begin.starts_inside {
                return self.exit(ray).is_some();
            }
            hit |= begin.crossing.is_some();
        }
        hit
    }

    /// Returns where a ray that starts inside leaves the union: the stretches that hang together with its start, followed from part to part.
    fn exit(&self, ray: &Ray) -> Option<Crossing> {
        let reach = reach(ray);
        let mut end = ray.t_min;
        loop {
            let before = end;
            for part in self.parts() {
                part.each_interval(ray, &mut |Interval { t_in, t_out }| {
                    if t_in > end && t_in > end + touching_gap(end, reach) {
                        return ControlFlow::Break(());
                    }
                    end = end.max(t_out);
                    ControlFlow::Continue(())
                });
            }
            if end >= ray.t_max {
                return None;
            }
            if end == before {
                return Some(Crossing { t: end, entering: false });
            }
        }
    }
}

/// Returns the ray parameter at which rounding of the origin shows.
fn reach(ray: &Ray) -> f64 {
    (ray.origin.length_squared() / ray.direction.length_squared()).sqrt()
}
