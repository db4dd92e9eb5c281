//! Records and the search for one: `radcache/record/nN/SCENE` is the time from samples to a record (layers, merging,
//! silhouettes), `radcache/best/COUNT` that of a search among so many records on a floor, `radcache/layers/N` that of
//! the layers alone.

use benches::moves;
use benches::rooms::uniform;
use criterion::{BenchmarkId, Criterion, Throughput};
use glam::{Vec3, Vec3A};
use hemimap::Frame;
use radcache::{Index, Record, RecordSettings, Samples, Validity, depth_layers};
use std::hint::black_box;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    records(&mut criterion);
    layers(&mut criterion);
    search(&mut criterion);
    criterion.final_summary();
}

fn records(criterion: &mut Criterion) {
    for n in [32, 64] {
        let mut group = criterion.benchmark_group(format!("radcache/record/n{n}"));
        for case in moves(n) {
            let elements = case.record.elements();
            let texels: usize =
                elements.size[..elements.len()].iter().map(|s| usize::from(s[0]) * usize::from(s[1])).sum();
            assert_eq!(texels, n * n, "{}: every texel in one element", case.name);
            assert!(elements.len() < n * n, "{}: some merge", case.name);
            let (frame, settings, validity) = (case.record.frame(), RecordSettings::default(), Validity::default());
            group.bench_function(BenchmarkId::from_parameter(case.name), |bencher| {
                bencher.iter_batched(
                    || case.record.samples().clone(),
                    |samples| Record::new(case.from, frame, samples, &settings, &validity),
                    criterion::BatchSize::SmallInput,
                );
            });
        }
        group.finish();
    }
}

/// Linear in the number of distances: the ratio of neighbours is 4.
fn layers(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("radcache/layers");
    for n in [16usize, 32, 64] {
        let distances: Vec<f32> = (0..n * n).map(|k| 0.1 / (uniform(k as u64) + 1e-3)).collect();
        let mut out = vec![0; n * n];
        depth_layers(&distances, 16, &mut out);
        let nearest = (0..n * n).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).expect("not empty");
        assert_eq!(out[nearest], 0, "the nearest is in the first layer");
        group.throughput(Throughput::Elements((n * n) as u64));
        group.bench_function(BenchmarkId::from_parameter(n * n), |bencher| {
            bencher.iter(|| {
                depth_layers(black_box(&distances), 16, &mut out);
                black_box(&out);
            });
        });
    }
    group.finish();
}

fn search(criterion: &mut Criterion) {
    let validity = Validity::default();
    let mut group = criterion.benchmark_group("radcache/best");
    for count in [100u64, 1000, 10_000] {
        // On a floor of 10 x 10 metres with reaches spread over a factor of 30, about ten of them over each point.
        let scale = 10.0 / (count as f32).sqrt();
        let mut index = Index::new(validity);
        index.extend((0..count).map(|k| {
            let height = scale * (0.3 + 4.0 * uniform(4 * k).powi(3));
            let samples = Samples::from_fn(4, |wi| (Vec3::ONE, height / wi.z, Vec3A::NEG_Z));
            let p = Vec3A::new(uniform(4 * k + 1), uniform(4 * k + 2), 0.0) * 10.0;
            Record::new(p, Frame::from_normal(Vec3A::Z), samples, &RecordSettings::default(), &validity)
        }));
        let points: Vec<Vec3A> =
            (0..1024).map(|k| Vec3A::new(uniform(1_000_000 + k), uniform(2_000_000 + k), 0.0) * 10.0).collect();
        for &p in &points[..64] {
            let naive = (0..index.len())
                .map(|k| (validity.misfit(index.record(k), p, Vec3A::Z), k))
                .filter(|(misfit, _)| *misfit <= 1.0)
                .min_by(|a, b| a.partial_cmp(b).expect("no misfit is NaN"));
            assert_eq!(index.best(p, Vec3A::Z).map(|f| (f.misfit, f.record)), naive, "the plain search at {p}");
        }
        let mut next = 0;
        group.bench_function(BenchmarkId::from_parameter(count), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % points.len();
                black_box(index.best(black_box(points[next]), Vec3A::Z))
            });
        });
    }
    group.finish();
}
