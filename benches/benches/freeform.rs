//! Rays against free forms: nearest hit, any hit and misses, by the number of perturbations.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use freeform::{FreeForm, Perturbation, Psi, Quadric, Ray, Solid};
use glam::DVec3;

const RAYS: u32 = 1024;

/// Returns point k of a Fibonacci spiral on the unit sphere.
fn spiral(k: u32, count: u32) -> DVec3 {
    let y = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
    let angle = f64::from(k) * TAU * 0.618_033_988_749_894_9;
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * angle.cos(), y, r * angle.sin())
}

/// Returns a ball with swellings and dents in turn all over it.
fn bumpy(count: u32) -> FreeForm {
    let ball = |center, radius| Quadric::sphere(center, radius).expect("a ball");
    let perturbations = (0..count)
        .map(|k| Perturbation {
            quadric: ball(spiral(k, count), 0.5),
            factor: if k.is_multiple_of(2) { 0.4 } else { -0.3 },
        })
        .collect();
    FreeForm::new(ball(DVec3::ZERO, 1.0), perturbations).expect("a sound form")
}

/// Returns rays from a sphere of radius 3 to points of one of radius `aim`.
fn rays(aim: f64) -> Vec<Ray> {
    (0..RAYS)
        .map(|k| {
            let origin = 3.0 * spiral(k, RAYS);
            Ray::new(origin, (aim * spiral(k * 389 % RAYS, RAYS) - origin).normalize())
        })
        .collect()
}

fn first_hit(c: &mut Criterion) {
    let mut group = c.benchmark_group("freeform/first_hit/perturbations");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    let rays = rays(0.9);
    for count in [0, 1, 4, 8, 16, 32] {
        let solid = Solid::from(bumpy(count));
        for ray in &rays {
            // Most rays hit; every hit is a zero of the function.
            if let Some(hit) = solid.first_hit(ray) {
                assert!(solid.value(ray.at(hit.t)).abs() < 1e-12, "{count} perturbations: {hit:?} is on the surface");
            }
        }
        let hits = rays.iter().filter(|ray| solid.any_hit(ray)).count();
        assert!(hits * 4 > rays.len() * 3, "{count} perturbations: {hits} hits");
        group.bench_function(count.to_string(), |b| {
            b.iter(|| rays.iter().filter(|ray| solid.first_hit(black_box(ray)).is_some()).count())
        });
    }
    group.finish();
}

fn miss(c: &mut Criterion) {
    let mut group = c.benchmark_group("freeform/miss/perturbations");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    for count in [0, 8, 32] {
        let solid = Solid::from(bumpy(count));
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
    for count in [0, 8, 32] {
        let solid = Solid::from(bumpy(count));
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

fn union(c: &mut Criterion) {
    let mut group = c.benchmark_group("freeform/first_hit/union");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    let rays = rays(0.9);
    for count in [2, 8] {
        let part = |k| {
            Solid::from(
                FreeForm::with_origin(spiral(k, count), *bumpy(0).base(), bumpy(4).perturbations().to_vec())
                    .expect("a sound form"),
            )
        };
        let solid = Solid::union(Psi::Maximum, (0..count).map(part).collect()).expect("parts");
        let mut inside = Vec::new();
        for ray in &rays {
            solid.intervals(ray, &mut inside);
            assert_eq!(
                solid.first_hit(ray).map(|hit| hit.t),
                inside.first().map(|i| i.t_in),
                "the first hit begins the first stretch"
            );
        }
        group.bench_function(count.to_string(), |b| {
            b.iter(|| rays.iter().filter(|ray| solid.first_hit(black_box(ray)).is_some()).count())
        });
    }
    group.finish();
}

criterion_group!(benches, first_hit, miss, intervals, union);
criterion_main!(benches);
