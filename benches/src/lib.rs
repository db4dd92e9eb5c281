//! Inputs that the benchmarks share.

#[expect(missing_docs, reason = "the scenes of the tests of the reprojection, described there")]
#[path = "../../reproject/tests/rooms/mod.rs"]
pub mod rooms;

pub mod bodies;
pub mod gathers;
pub mod outlines;
pub mod plot;
pub mod renders;

use glam::Vec3A;
use radcache::{Record, RecordSettings};
use rooms::Scene;

/// A scene with a record on its floor and a point nearby.
#[derive(Debug)]
pub struct Move {
    /// Name for ids.
    pub name: &'static str,
    /// The scene.
    pub scene: Scene,
    /// Made at [`Self::from`], normal up.
    pub record: Record,
    /// Where the record was made.
    pub from: Vec3A,
    /// Half the radius of the record away from it.
    pub to: Vec3A,
}

/// Records with `n x n` texels in four scenes: a room with two blocks, with 60 boxes, with spheres, and a yard under
/// the sky.
#[must_use]
pub fn moves(n: usize) -> Vec<Move> {
    let scenes = [
        ("cornell", Scene::cornell(), Vec3A::new(0.6, 0.55, -0.999)),
        ("clutter", Scene::clutter(60), Vec3A::new(0.1, 0.05, -0.999)),
        ("spheres", Scene::spheres(), Vec3A::new(0.2, 0.1, -0.999)),
        ("yard", Scene::yard(), Vec3A::new(0.3, -0.4, -0.999)),
    ];
    scenes
        .into_iter()
        .map(|(name, scene, from)| {
            let record = rooms::record(|p, wi| scene.look(p, wi), from, Vec3A::Z, n, &RecordSettings::default());
            let to = from + Vec3A::new(0.8, 0.6, 0.0) * (0.5 * record.radius());
            Move { name, scene, record, from, to }
        })
        .collect()
}
