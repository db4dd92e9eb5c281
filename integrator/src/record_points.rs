//! Where a cache has its points, for those who want to see it.

use glam::Vec3;

use crate::irradiance_cache;

/// What a record keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordKind {
    /// Incident radiance from each direction, which is reprojected.
    Radiance,
    /// Irradiance with its gradients, which is interpolated.
    Irradiance,
}

/// The place of a record, how far it reaches and how much light it has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordPoint {
    /// What it keeps.
    pub kind: RecordKind,
    /// Position, world space, metres.
    pub p: Vec3,
    /// Unit normal there, world space.
    pub n: Vec3,
    /// No point farther off takes anything from it, metres.
    pub reach: f32,
    /// Mean incident radiance over the projected hemisphere, W m^-2 sr^-1: irradiance over pi.
    pub radiance: Vec3,
}

/// Returns the records of both caches, those of radiance first, each in the order in which they were made.
pub(crate) fn record_points(records: &radcache::Index, irradiance: &irradiance_cache::Index) -> Vec<RecordPoint> {
    let of_radiance = records.records().iter().map(|record| RecordPoint {
        kind: RecordKind::Radiance,
        p: record.centre().into(),
        n: record.frame().n.into(),
        reach: record.radius(),
        radiance: record.mean_radiance(),
    });
    let of_irradiance = irradiance.records().iter().map(|record| RecordPoint {
        kind: RecordKind::Irradiance,
        p: record.centre().into(),
        n: record.normal().into(),
        reach: record.reach(),
        radiance: record.mean_radiance(),
    });
    of_radiance.chain(of_irradiance).collect()
}
