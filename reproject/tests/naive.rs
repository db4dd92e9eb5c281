//! The whole reprojection against one that asks of each texel, layer by layer, which polygons hold its centre: in
//! doubles, by the map of `hemimap`, with no masks, no lanes and no short cuts.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "texels are at most 64 x 64")]

mod rooms;

use glam::{DVec2, DVec3, Vec3, Vec3A};
use radcache::{Elements, Record};
use reproject::{AreaWeights, Coverage, Kernel, Settings, Trails, Workspace};
use rooms::{Rays, Scene, every_kind_of_record, every_setting, uniform};

/// Places in the square are so exact in single precision. A texel whose centre is as near to an edge is left out.
const ROUNDING: f64 = 2e-6;

/// Where a point in the frame of the receiver is in the square: one below the horizon on the rim.
fn place(p: DVec3) -> DVec2 {
    hemimap::double::cosine_hemisphere_to_square(p.with_z(p.z.max(0.0)).normalize())
}

/// Where the edge between two points, one of them below the horizon, crosses it.
fn crossing(a: DVec3, b: DVec3) -> DVec2 {
    place(a.lerp(b, a.z / (a.z - b.z)))
}

/// The part of a quadrilateral above the horizon.
fn clipped(corners: &[DVec3; 4]) -> Vec<DVec2> {
    let mut polygon = Vec::new();
    for k in 0..4 {
        let (a, b) = (corners[k], corners[(k + 1) % 4]);
        if a.z >= 0.0 {
            polygon.push(place(a));
        }
        if (a.z >= 0.0) != (b.z >= 0.0) {
            polygon.push(crossing(a, b));
        }
    }
    polygon
}

/// The corners of a quadrilateral, those below the horizon moved along their edges as long as that leaves four.
fn lifted(corners: &[DVec3; 4]) -> [DVec2; 4] {
    let above = corners.map(|corner| corner.z >= 0.0);
    let neighbours = |k: usize| [(k + 1) % 4, (k + 3) % 4];
    let alone = (0..4).any(|k| !above[k] && neighbours(k).iter().all(|&k| above[k]));
    if alone || !above.contains(&true) {
        return corners.map(place);
    }
    let on_edge =
        |k: usize| neighbours(k).into_iter().find(|&k| above[k]).map(|other| crossing(corners[k], corners[other]));
    [0, 1, 2, 3].map(|k| match above[k] {
        true => place(corners[k]),
        false => on_edge(k).unwrap_or_else(|| on_edge((k + 1) % 4).expect("one of four is above")),
    })
}

fn area(polygon: &[DVec2]) -> f64 {
    (0..polygon.len()).map(|k| 0.5 * polygon[k].perp_dot(polygon[(k + 1) % polygon.len()])).sum()
}

fn enclosing(points: &[DVec2]) -> [DVec2; 2] {
    let [low, high] = [DVec2::min, DVec2::max].map(|f| points.iter().copied().reduce(f).expect("there are points"));
    [low, high]
}

fn rectangle([low, high]: [DVec2; 2]) -> Vec<DVec2> {
    vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
}

/// Whether a polygon holds a point, that is, whether a ray from there meets the outline an odd number of times; nothing
/// if rounding may decide.
fn holds(polygon: &[DVec2], p: DVec2) -> Option<bool> {
    let mut inside = false;
    for (k, &a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let along = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-30)).clamp(0.0, 1.0);
        if p.distance(a.lerp(b, along)) < ROUNDING {
            return None;
        }
        inside ^= (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x);
    }
    Some(inside)
}

/// What a point and its record are to each other.
struct View<'a> {
    elements: &'a Elements,
    offset: DVec3,
    /// From the frame of the record to that of the point.
    turn: [DVec3; 3],
    n: usize,
    settings: Settings,
}

impl View<'_> {
    fn turned(&self, p: DVec3) -> DVec3 {
        DVec3::from_array(self.turn.map(|axis| axis.dot(p)))
    }

    fn corners(&self, e: usize) -> [DVec3; 4] {
        let offset = self.offset * f64::from(self.elements.finite[e]);
        [0, 1, 2, 3].map(|k| self.turned(self.elements.corner(e, k).as_dvec3() - offset))
    }

    /// The texels that a polygon holds, or may hold: each with whether that is sure.
    fn texels(&self, polygon: &[DVec2]) -> Vec<(usize, bool)> {
        let n = self.n;
        let [low, high] =
            enclosing(polygon).map(|corner| (corner * n as f64).clamp(DVec2::ZERO, DVec2::splat(n as f64)));
        let range = |low: f64, high: f64| (low - 1.0).max(0.0) as usize..(high.ceil() as usize + 1).min(n);
        let mut texels = Vec::new();
        for j in range(low.y, high.y) {
            for i in range(low.x, high.x) {
                let held = holds(polygon, (DVec2::new(i as f64, j as f64) + 0.5) / n as f64);
                if held != Some(false) {
                    texels.push((j * n + i, held.is_some()));
                }
            }
        }
        texels
    }

    /// What side `side` of the outline uncovered.
    fn uncovered(&self, side: usize) -> Vec<(usize, bool)> {
        let outline = self.elements.outline();
        let step = outline.normal(side).as_dvec3().dot(self.offset);
        let sure = step.abs() > 1e-6 * self.offset.length();
        if sure && step > 0.0 {
            return Vec::new();
        }
        let share = if self.settings.trails == Trails::Uncovered { f64::from(outline.behind[side]) } else { 0.0 };
        let margin = if self.settings.margins { f64::from(outline.margin[side]) } else { 0.0 };
        let padded = self.elements.padded_len();
        let [now, before] = {
            let ends = outline.ends.each_ref().map(|ends| usize::from(ends[side]));
            let now = ends.map(|end| lifted(&self.corners(end % padded))[end / padded]);
            let before = [0, 1].map(|end| DVec2::new(outline.u[end][side].into(), outline.v[end][side].into()));
            let seen = ends.map(|end| place(self.turned(self.elements.corner(end % padded, end / padded).as_dvec3())));
            // A corner on the rim has two places in the square or more; the record knows which one it was.
            let is_turned = self.turn[2] != DVec3::Z;
            [now, if is_turned { seen } else { before }]
        };
        let start = [0, 1].map(|end| before[end].lerp(now[end], share));
        let edge = now[1] - now[0];
        let mut doubtful = !sure;
        let inner = [0, 1].map(|end| {
            let way = now[end] - start[end];
            let inwards = edge.perp_dot(way);
            doubtful |= inwards.abs() < ROUNDING * edge.length();
            if inwards > 0.0 {
                // As far again, but no more than the margin.
                (now[end] + way.clamp_length_max(margin)).clamp(DVec2::ZERO, DVec2::ONE)
            } else if edge.length() < ROUNDING {
                now[end]
            } else {
                start[end]
            }
        });
        if !doubtful {
            return self.texels(&[start[0], start[1], inner[1], inner[0]]);
        }
        // Whatever it may have left.
        let far = [0, 1].map(|end| now[end] + (now[end] - start[end]).clamp_length_max(margin));
        let around = enclosing(&[start, now, far].concat());
        let around = rectangle([around[0] - 2.0 * ROUNDING, around[1] + 2.0 * ROUNDING]);
        self.texels(&around).into_iter().map(|(texel, _)| (texel, false)).collect()
    }

    /// The rectangle around both places of element `e`.
    fn swept(&self, e: usize, now: &[DVec2; 4]) -> Vec<(usize, bool)> {
        let is_turned = self.turn[2] != DVec3::Z;
        let before = [0, 1, 2, 3].map(|k| {
            let [u, v] = self.elements.grid_corner(e, k).map(f64::from);
            let corner = self.turned(self.elements.corner(e, k).as_dvec3());
            if is_turned { place(corner) } else { DVec2::new(u, v) / self.n as f64 }
        });
        self.texels(&rectangle(enclosing(&[before, *now].concat())))
    }
}

/// What becomes of a texel.
#[derive(Clone, Copy, Default)]
struct Texel {
    filled: bool,
    unknown: bool,
    /// The element that fills it, and its layer; nobody fills what lies below the surface.
    owner: Option<(usize, usize)>,
    /// Whether rounding may have decided any of that.
    doubtful: bool,
}

impl Texel {
    fn is_closed(&self) -> bool {
        self.filled || self.unknown
    }
}

/// Makes unknown what is open, and doubtful what may be.
fn hide(texels: &mut [Texel], hidden: Vec<(usize, bool)>) {
    for (texel, is_sure) in hidden {
        let texel = &mut texels[texel];
        texel.doubtful |= !is_sure && !texel.is_closed();
        texel.unknown |= is_sure && !texel.filled;
    }
}

/// The texels of a point whose surface has the normal `ng` in its own frame. And what all elements weigh, and that
/// times their red light, unless rounding may have a part in it.
fn reproject_naively(view: &View<'_>, record: &Record, ng: DVec3) -> (Vec<Texel>, Option<[f64; 2]>) {
    let (elements, n, settings) = (view.elements, view.n, view.settings);
    let count = (n * n) as f64;
    let mut texels = vec![Texel::default(); n * n];
    let depth = -view.offset.z / f64::from(record.harmonic_distance());
    let (mut weight, mut red, mut is_sure) = (0.0, 0.0, true);
    for (number, texel) in texels.iter_mut().enumerate() {
        let centre = DVec2::new((number % n) as f64 + 0.5, (number / n) as f64 + 0.5) / n as f64;
        let wi = hemimap::double::square_to_cosine_hemisphere(centre);
        let above = wi.dot(ng);
        texel.filled = above <= 0.0;
        texel.doubtful = above.abs() < ROUNDING;
        weight += f64::from(u8::from(texel.filled)) / count;
        if settings.doubt && depth > 1e-4 && !texel.filled {
            let over = wi.dot(view.turned(DVec3::Z)) - depth / 0.03;
            texel.unknown = over <= 0.0;
            texel.doubtful |= over.abs() < ROUNDING;
        }
    }
    for layer in 0..elements.layer_count() {
        if settings.trails != Trails::All {
            // They close what they uncover before any element of the layer is drawn, so they are all found first.
            let trails: Vec<_> = elements.outline().layer(layer).flat_map(|side| view.uncovered(side)).collect();
            hide(&mut texels, trails);
        }
        let before = texels.clone();
        let mut hidden = Vec::new();
        for e in elements.layer(layer) {
            let corners = view.corners(e);
            let (quad, polygon) = (lifted(&corners), clipped(&corners));
            if settings.trails == Trails::All && elements.finite[e] != 0.0 {
                hidden.extend(view.swept(e, &quad));
            }
            if polygon.is_empty() {
                continue;
            }
            let area = area(&polygon);
            let outline = if settings.coverage == Coverage::Quad { polygon } else { rectangle(enclosing(&polygon)) };
            let mut held = view.texels(&outline);
            // Where an element is seen on edge, rounding tells which side is.
            if area.abs() < ROUNDING * outline.iter().map(|p| p.distance(outline[0])).sum::<f64>() {
                is_sure = false;
                held.iter_mut().for_each(|(_, is_sure)| *is_sure = false);
            }
            if area <= 0.0 || elements.view_dependent[e] {
                hidden.extend(held);
                continue;
            }
            let (mut covered, mut taken) = (0.0, 0.0);
            for &(number, holds) in &held {
                is_sure &= holds && !before[number].doubtful;
                covered += 1.0;
                let texel = &mut texels[number];
                if !before[number].is_closed() {
                    taken += 1.0;
                    texel.doubtful |= !holds;
                    texel.filled = true;
                    texel.owner = texel.owner.or(Some((e, layer)));
                }
            }
            let share = match settings.weights {
                AreaWeights::Bits => taken / count,
                AreaWeights::Analytic if covered > 0.0 => area * taken / covered,
                AreaWeights::Analytic => {
                    // Smaller than a texel: it weighs by its area where its middle is open, or was filled by one of the
                    // last few layers.
                    let middle = quad.into_iter().sum::<DVec2>() / 4.0 * n as f64;
                    is_sure &= (middle - middle.round()).abs().min_element() > ROUNDING * n as f64;
                    let [i, j] = middle.to_array().map(|x| (x as usize).min(n - 1));
                    let middle = before[j * n + i];
                    is_sure &= !middle.doubtful;
                    let recent = middle.owner.is_some_and(|(_, filled)| filled + 4 >= layer);
                    if middle.unknown || middle.filled && !recent { 0.0 } else { area }
                }
            };
            weight += share;
            red += share * f64::from(elements.radiance[0][e]);
        }
        hide(&mut texels, hidden);
    }
    (texels, is_sure.then_some([weight, red]))
}

#[test]
fn masks_owners_and_sums_are_those_of_a_naive_reprojection() {
    let mut workspace = Workspace::with_kernel(Kernel::Scalar);
    let (mut compared, mut doubtful, mut sums) = (0, 0, 0);
    for (number, scene) in [Scene::cornell(), Scene::clutter(60), Scene::spheres(), Scene::yard()].iter().enumerate() {
        for (n, places) in [(3, 12), (7, 12), (16, 4), (32, 2), (33, 1), (64, 1)] {
            for place in 0..places {
                let random = |k| uniform(7000 * number as u64 + 100 * place + 10 * n as u64 + k) - 0.5;
                let from = Vec3A::new(1.6 * random(0), 1.6 * random(1), -0.999);
                let record = every_kind_of_record(scene, from, n, place);
                let to = from + Vec3A::new(random(2), random(3), 0.1 * random(4)) * (1.5 * record.radius());
                let turned = Vec3A::new(random(5), random(6), 1.0).normalize();
                for [normal, ng] in [[Vec3A::Z, Vec3A::Z], [turned, turned], [turned, Vec3A::Z]] {
                    for settings in every_setting() {
                        workspace.project_above(&record, to, normal, ng, &settings);
                        let view = view(&workspace, &record, to, n, settings);
                        let ng = if ng == normal { DVec3::Z } else { workspace.frame().to_local(ng).as_dvec3() };
                        let (texels, sum) = reproject_naively(&view, &record, ng);
                        let what = format!("scene {number}, n = {n}, place {place}, {normal}, {settings:?}");
                        doubtful += compare(&mut workspace, &texels, sum, &what);
                        compared += n * n;
                        sums += usize::from(sum.is_some());
                    }
                }
            }
        }
    }
    assert!(doubtful * 1000 < compared, "{doubtful} of {compared} texels left out");
    assert!(sums > 5000, "only {sums} sums compared");
}

fn view<'a>(workspace: &Workspace, record: &'a Record, to: Vec3A, n: usize, settings: Settings) -> View<'a> {
    let (own, frame) = (record.frame(), workspace.frame());
    let axes = [own.s, own.t, own.n].map(|axis| axis.as_dvec3());
    let turn = [frame.s, frame.t, frame.n].map(|axis| DVec3::from_array(axes.map(|own| own.dot(axis.as_dvec3()))));
    let offset = own.to_local(to - record.centre()).as_dvec3();
    View { elements: record.elements(), offset, turn, n, settings }
}

/// Compares all that is sure, and gives the number of texels that are not.
fn compare(workspace: &mut Workspace, texels: &[Texel], sum: Option<[f64; 2]>, what: &str) -> usize {
    let n = workspace.resolution();
    let mut doubtful = 0;
    for (number, texel) in texels.iter().enumerate() {
        if texel.doubtful {
            doubtful += 1;
            continue;
        }
        let bit = |rows: &[u64]| rows[number / n] >> (number % n) & 1 == 1;
        let found = (bit(&workspace.masks().fill), bit(&workspace.masks().unknown), workspace.owner(number));
        assert_eq!(found, (texel.filled, texel.unknown, texel.owner.map(|(e, _)| e)), "texel {number}, {what}");
    }
    if let Some([weight, red]) = sum
        && weight > 0.0
    {
        let mean = |workspace: &Workspace, share: f64| {
            let (found, expected) = (f64::from(workspace.mean_radiance().x), red / share);
            assert!((found - expected).abs() < 1e-4 * expected + 1e-6, "{found} instead of {expected}, {what}");
        };
        mean(workspace, weight);
        // With black holes, what the elements weigh shows too.
        let holes = texels.iter().filter(|texel| !texel.filled).count();
        workspace.trace_holes(1, 0, &mut Rays(Vec3A::ZERO, |_, wi: Vec3A| (Vec3::ZERO, 1.0, -wi)));
        mean(workspace, weight + holes as f64 / (n * n) as f64);
    }
    doubtful
}
