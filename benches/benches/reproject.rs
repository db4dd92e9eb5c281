//! The reprojection of one record to one point: `reproject/n32/PART/SCENE`, no ray traced.
//!
//! `scalar` is all of it: projection, masks, weights and sum. `corners` is its first part alone; `paper` is the paper's
//! own variant; `weighted_sum` is what a glossy lobe adds. Times are for one reprojection.

use benches::rooms::{Rays, gather};
use benches::{Move, moves};
use criterion::{BenchmarkId, Criterion};
use glam::{Mat3A, Vec3, Vec3A};
use reproject::{AreaWeights, Coverage, Settings, Trails, Workspace, project_corners};
use std::hint::black_box;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    for n in [16, 32, 64] {
        let moves = moves(n);
        moves.iter().for_each(check);
        whole(&mut criterion, n, &moves);
        if n == 32 {
            parts(&mut criterion, n, &moves);
        }
    }
    criterion.final_summary();
}

/// With its hole rays the reprojection gives what 256 x 256 rays find, within what n resolves.
fn check(case: &Move) {
    let mut workspace = Workspace::new();
    let shares = workspace.project(&case.record, case.to, Vec3A::Z, &Settings::default());
    workspace.trace_holes(1, 1, &mut Rays(case.to, |p, wi| case.scene.look(p, wi)));
    let oracle = gather(|p, wi| case.scene.look(p, wi), case.to, &workspace.frame(), 256);
    let error = (workspace.mean_radiance() / oracle - Vec3::ONE).abs().max_element();
    let limit = 1.6 / workspace.resolution() as f32;
    assert!(error < limit, "{}: off by {error}, {shares:?}", case.name);
    assert!(shares.filled > 0.5, "{}: the record serves the point", case.name);
}

fn whole(criterion: &mut Criterion, n: usize, moves: &[Move]) {
    let mut group = criterion.benchmark_group(format!("reproject/n{n}"));
    for case in moves {
        let mut workspace = Workspace::new();
        group.bench_function(BenchmarkId::new("scalar", case.name), |bencher| {
            bencher.iter(|| {
                workspace.project(black_box(&case.record), black_box(case.to), Vec3A::Z, &Settings::default());
                black_box(workspace.mean_radiance())
            });
        });
    }
    group.finish();
}

fn parts(criterion: &mut Criterion, n: usize, moves: &[Move]) {
    let mut group = criterion.benchmark_group(format!("reproject/n{n}"));
    for case in moves {
        let elements = case.record.elements();
        let buffer = || [(); 4].map(|()| vec![0f32; elements.padded_len()]);
        let (mut u, mut v, mut z) = (buffer(), buffer(), buffer());
        let offset = case.record.frame().to_local(case.to - case.from);
        group.bench_function(BenchmarkId::new("corners", case.name), |bencher| {
            bencher.iter(|| {
                project_corners(black_box(elements), &Mat3A::IDENTITY, offset, &mut u, &mut v, &mut z);
                black_box((&u, &v, &z));
            });
        });
        let paper = Settings {
            coverage: Coverage::Rectangle,
            trails: Trails::All,
            weights: AreaWeights::Bits,
            ..Settings::default()
        };
        let mut workspace = Workspace::new();
        group.bench_function(BenchmarkId::new("paper", case.name), |bencher| {
            bencher.iter(|| {
                workspace.project(black_box(&case.record), black_box(case.to), Vec3A::Z, &paper);
                black_box(workspace.mean_radiance())
            });
        });
        workspace.project(&case.record, case.to, Vec3A::Z, &Settings::default());
        let weights = vec![Vec3::splat(1.0 / (n * n) as f32); n * n];
        group.bench_function(BenchmarkId::new("weighted_sum", case.name), |bencher| {
            bencher.iter(|| black_box(workspace.weighted_sum(black_box(&case.record), black_box(&weights))));
        });
    }
    group.finish();
}
