//! The reprojection of one record to one point, no ray traced: projection, masks, trails, weights and sum.
//!
//! `reproject/n32/KERNEL/SCENE` are real gathers, a dozen pairs of record and point in turn;
//! `reproject/nN/KERNEL/SCENE` for other N are rooms of a few shapes with the widest kernel. `corners` is the first
//! part alone; `paper` is the paper's own variant; `project_weighted_sum` has the sum over texels too that a glossy
//! lobe needs. Times are for one reprojection.

use benches::gathers::{Gathers, gathers};
use benches::rooms::{Rays, gather};
use benches::{Move, moves};
use criterion::{BenchmarkId, Criterion};
use glam::{Mat3A, Vec3, Vec3A};
use reproject::{AreaWeights, Coverage, Kernel, Settings, Trails, Workspace, project_corners};
use std::hint::black_box;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    for scene in gathers(32) {
        kernels(&mut criterion, &scene);
    }
    for n in [16, 32, 64] {
        let moves = moves(n);
        moves.iter().for_each(check);
        if n == 32 {
            parts(&mut criterion, n, &moves);
        } else {
            widest(&mut criterion, n, &moves);
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

/// Each kernel over the pairs of a scene in turn, after its answers were found to be those of the scalar one.
fn kernels(criterion: &mut Criterion, scene: &Gathers) {
    let settings = Settings::default();
    let mut group = criterion.benchmark_group("reproject/n32");
    let mut scalar = Workspace::with_kernel(Kernel::Scalar);
    for kernel in Kernel::ALL.into_iter().filter(|kernel| kernel.is_supported()) {
        let mut workspace = Workspace::with_kernel(kernel);
        for pair in &scene.pairs {
            let [found, expected] = [&mut workspace, &mut scalar].map(|workspace| {
                let shares = workspace.project(&pair.record, pair.to, pair.normal, &settings);
                (shares, workspace.mean_radiance())
            });
            assert_eq!(found, expected, "{kernel:?} in {}", scene.name);
        }
        let mut next = 0;
        group.bench_function(BenchmarkId::new(kernel.name(), scene.name), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % scene.pairs.len();
                let pair = black_box(&scene.pairs[next]);
                workspace.project(&pair.record, pair.to, pair.normal, &settings);
                black_box(workspace.mean_radiance())
            });
        });
    }
    group.finish();
}

fn widest(criterion: &mut Criterion, n: usize, moves: &[Move]) {
    let mut group = criterion.benchmark_group(format!("reproject/n{n}"));
    for case in moves {
        let mut workspace = Workspace::new();
        group.bench_function(BenchmarkId::new(workspace.kernel().name(), case.name), |bencher| {
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
        let weights = vec![Vec3::splat(1.0 / (n * n) as f32); n * n];
        group.bench_function(BenchmarkId::new("project_weighted_sum", case.name), |bencher| {
            bencher.iter(|| {
                workspace.project(black_box(&case.record), black_box(case.to), Vec3A::Z, &Settings::default());
                black_box(workspace.weighted_sum(black_box(&case.record), black_box(&weights)))
            });
        });
    }
    group.finish();
}
