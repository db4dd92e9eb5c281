//! The hemisphere maps, one at a time and over slices: `hemimap/MAP/{scalar,slice}/COUNT`, elements per second.

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::{Vec2, Vec3A};
use hemimap::{
    Frame, cosine_hemisphere_to_square, cosine_hemisphere_to_square_slice, square_to_cosine_hemisphere,
    square_to_cosine_hemisphere_slice,
};
use std::hint::black_box;

/// 4096 elements of 5 arrays take 80 KB: they fit the L2 cache, as a record's elements do.
const COUNT: usize = 4096;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    to_hemisphere(&mut criterion);
    to_square(&mut criterion);
    frames(&mut criterion);
    criterion.final_summary();
}

/// Points of the plastic sequence (Roberts 2018): even over the square, so that branches would be hard to predict.
fn squares() -> Vec<Vec2> {
    (1..=COUNT).map(|i| (i as f32 * Vec2::new(0.754_877_7, 0.569_840_3)).fract()).collect()
}

fn to_hemisphere(criterion: &mut Criterion) {
    let points = squares();
    let (u, v): (Vec<f32>, Vec<f32>) = points.iter().map(|u| (u.x, u.y)).unzip();
    let mut directions = vec![Vec3A::ZERO; COUNT];
    let [mut x, mut y, mut z] = [(); 3].map(|()| vec![0f32; COUNT]);
    let mut group = criterion.benchmark_group("hemimap/square_to_cosine_hemisphere");
    group.throughput(Throughput::Elements(COUNT as u64));

    square_to_cosine_hemisphere_slice(&u, &v, &mut x, &mut y, &mut z);
    for (i, u) in points.iter().enumerate() {
        let w = square_to_cosine_hemisphere(*u);
        assert!((w.length() - 1.0).abs() < 3e-7, "{u} gives a direction of length {}", w.length());
        assert_eq!(w, Vec3A::new(x[i], y[i], z[i]), "both forms at {u}");
    }
    group.bench_function(BenchmarkId::new("scalar", COUNT), |bencher| {
        bencher.iter(|| {
            for (w, u) in directions.iter_mut().zip(black_box(&points)) {
                *w = square_to_cosine_hemisphere(*u);
            }
            black_box(&mut directions);
        });
    });
    group.bench_function(BenchmarkId::new("slice", COUNT), |bencher| {
        bencher.iter(|| {
            square_to_cosine_hemisphere_slice(black_box(&u), black_box(&v), &mut x, &mut y, &mut z);
            black_box((&mut x, &mut y, &mut z));
        });
    });
    group.finish();
}

fn to_square(criterion: &mut Criterion) {
    let points = squares();
    let directions: Vec<_> = points.iter().map(|u| square_to_cosine_hemisphere(*u)).collect();
    let (x, y): (Vec<f32>, Vec<f32>) = directions.iter().map(|w| (w.x, w.y)).unzip();
    let mut back = vec![Vec2::ZERO; COUNT];
    let [mut u, mut v] = [(); 2].map(|()| vec![0f32; COUNT]);
    let mut group = criterion.benchmark_group("hemimap/cosine_hemisphere_to_square");
    group.throughput(Throughput::Elements(COUNT as u64));

    cosine_hemisphere_to_square_slice(&x, &y, &mut u, &mut v);
    for (i, w) in directions.iter().enumerate() {
        let got = cosine_hemisphere_to_square(*w);
        assert!((got - points[i]).abs().max_element() <= 4.0 * f32::EPSILON, "{} comes back as {got}", points[i]);
        assert_eq!(got, Vec2::new(u[i], v[i]), "both forms at {w}");
    }
    group.bench_function(BenchmarkId::new("scalar", COUNT), |bencher| {
        bencher.iter(|| {
            for (u, w) in back.iter_mut().zip(black_box(&directions)) {
                *u = cosine_hemisphere_to_square(*w);
            }
            black_box(&mut back);
        });
    });
    group.bench_function(BenchmarkId::new("slice", COUNT), |bencher| {
        bencher.iter(|| {
            cosine_hemisphere_to_square_slice(black_box(&x), black_box(&y), &mut u, &mut v);
            black_box((&mut u, &mut v));
        });
    });
    group.finish();
}

fn frames(criterion: &mut Criterion) {
    let normals: Vec<_> = squares().into_iter().map(square_to_cosine_hemisphere).collect();
    let start = Frame::from_normal(Vec3A::Z);
    let mut out = vec![start; COUNT];
    let mut group = criterion.benchmark_group("hemimap/frame");
    group.throughput(Throughput::Elements(COUNT as u64));

    for (name, make) in [
        ("from_normal", (|_: &Frame, n| Frame::from_normal(n)) as fn(&Frame, Vec3A) -> Frame),
        ("transported_to", |start, n| start.transported_to(n)),
    ] {
        for n in &normals {
            let frame = make(&start, *n);
            assert!((frame.s.cross(frame.t) - *n).length() < 1e-6, "{name} at {n} is right-handed");
        }
        group.bench_function(BenchmarkId::new(name, COUNT), |bencher| {
            bencher.iter(|| {
                for (frame, n) in out.iter_mut().zip(black_box(&normals)) {
                    *frame = make(&start, *n);
                }
                black_box(&mut out);
            });
        });
    }
    group.finish();
}
