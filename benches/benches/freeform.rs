//! Rays against free forms: nearest hit, misses and all intervals, by the number of perturbations, of leaves and of
//! blended leaves.

use std::hint::black_box;

use benches::bodies::{bumpy, spiral, tree};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use freeform::{Psi, Ray, Solid};

const RAYS: u32 = 1024;

/// Returns rays from a sphere of radius 3 to points of one of radius `aim`.
fn rays(aim: f64) -> Vec<Ray> {
    (0..RAYS)
        .map(|k| {
            let origin = 3.0 * spiral(k, RAYS);
            Ray::new(origin, (aim * spiral(k * 389 % RAYS, RAYS) - origin).normalize())
        })
        .collect()
}

/// Times the nearest hits of a body of each count, of which all are zeros of its function.
fn first_hits(c: &mut Criterion, group: &str, counts: &[u32], body: impl Fn(u32) -> Solid) {
    let mut group = c.benchmark_group(format!("freeform/first_hit/{group}"));
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    let rays = rays(0.9);
    for &count in counts {
        let solid = body(count);
        let hits: Vec<_> = rays.iter().filter_map(|ray| Some((ray, solid.first_hit(ray)?))).collect();
        for (ray, hit) in &hits {
            let p = ray.at(hit.t);
            let off = solid.value(p).abs() / solid.gradient(p).length();
            assert!(off < 1e-11, "{count}: {hit:?} is {off} off the surface");
        }
        assert!(hits.len() * 4 > rays.len() * 3, "{count}: {} hits", hits.len());
        group.bench_function(count.to_string(), |b| {
            b.iter(|| rays.iter().filter(|ray| solid.first_hit(black_box(ray)).is_some()).count())
        });
    }
    group.finish();
}

fn first_hit(c: &mut Criterion) {
    first_hits(c, "perturbations", &[0, 1, 8, 64, 512], bumpy);
    first_hits(c, "trees", &[2, 10, 100, 1000], |leaves| tree(leaves, Psi::Maximum));
    first_hits(c, "blends", &[2, 10, 100], |leaves| tree(leaves, Psi::Blend { width: 0.2 }));
}

fn miss(c: &mut Criterion) {
    let mut group = c.benchmark_group("freeform/miss/perturbations");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    for count in [0, 8, 64] {
        let solid = bumpy(count);
        // Through the corners of the box, past the form.
        let rays: Vec<Ray> =
            rays(1.6).into_iter().filter(|ray| !solid.any_hit(ray)).cycle().take(RAYS as usize).collect();
        assert_eq!(rays.len(), RAYS as usize, "some rays miss");
        group.bench_function(count.to_string(), |b| {
            b.iter(|| rays.iter().filter(|ray| solid.any_hit(black_box(ray))).count())
        });
    }
    group.finish();
}

fn intervals(c: &mut Criterion) {
    let mut group = c.benchmark_group("freeform/intervals/perturbations");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    let rays = rays(0.9);
    let mut inside = Vec::new();
    for count in [0, 8, 64] {
        let solid = bumpy(count);
        for ray in &rays {
            solid.intervals(ray, &mut inside);
            let first = inside.first().map(|i| i.t_in);
            assert_eq!(solid.first_hit(ray).map(|hit| hit.t), first, "the first hit begins the first stretch");
        }
        group.bench_function(count.to_string(), |b| {
            b.iter(|| {
                let mut stretches = 0;
                for ray in &rays {
                    solid.intervals(black_box(ray), &mut inside);
                    stretches += inside.len();
                }
                stretches
            });
        });
    }
    group.finish();
}

criterion_group!(benches, first_hit, miss, intervals);
criterion_main!(benches);
