//! The slice forms: the bits of the scalar forms, at every length, on every system.

use crate::random::Random;
use hemimap::glam::{Vec2, Vec3A};
use hemimap::*;

/// Square points with all that is special among them, then random ones.
fn squares(count: usize) -> (Vec<f32>, Vec<f32>) {
    let edge = [0.0, 0.5, 1.0, 0.25, 0.75, 1.0 - f32::EPSILON / 2.0, 0.5 + f32::EPSILON / 2.0];
    let mut random = Random(11);
    let special = edge.iter().flat_map(|u| edge.map(|v| Vec2::new(*u, v))).collect::<Vec<_>>();
    special.into_iter().chain(std::iter::repeat_with(|| random.square())).take(count).map(|u| (u.x, u.y)).unzip()
}

#[test]
fn slices_have_the_bits_of_the_scalars() {
    // Lengths around every lane count, so that each remainder loop runs.
    for n in (0..70).chain([4096, 100_003]) {
        let (u, v) = squares(n);
        let [mut x, mut y, mut z, mut p, mut q] = [(); 5].map(|()| vec![f32::NAN; n]);
        square_to_cosine_hemisphere_slice(&u, &v, &mut x, &mut y, &mut z);
        cosine_hemisphere_to_square_slice(&x, &y, &mut p, &mut q);
        for i in 0..n {
            let w = square_to_cosine_hemisphere(Vec2::new(u[i], v[i]));
            assert_eq!([x[i], y[i], z[i]].map(f32::to_bits), w.to_array().map(f32::to_bits), "{i} of {n}");
            let back = cosine_hemisphere_to_square(w);
            assert_eq!([p[i], q[i]].map(f32::to_bits), back.to_array().map(f32::to_bits), "{i} of {n}");
        }
        square_to_uniform_hemisphere_slice(&u, &v, &mut x, &mut y, &mut z);
        uniform_hemisphere_to_square_slice(&x, &y, &z, &mut p, &mut q);
        for i in 0..n {
            let w = square_to_uniform_hemisphere(Vec2::new(u[i], v[i]));
            assert_eq!(Vec3A::new(x[i], y[i], z[i]), w, "{i} of {n}");
            assert_eq!(Vec2::new(p[i], q[i]), uniform_hemisphere_to_square(w), "{i} of {n}");
        }
    }
}

#[test]
fn bits_are_the_same_on_every_system() {
    let (u, v) = squares(10_000);
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut add = |value: f32| {
        hash = (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0000_0100_0000_01B3);
    };
    for (u, v) in u.into_iter().zip(v) {
        let u = Vec2::new(u, v);
        let (c, h) = (square_to_cosine_hemisphere(u), square_to_uniform_hemisphere(u));
        let back = [cosine_hemisphere_to_square(c), uniform_hemisphere_to_square(h)];
        c.to_array().into_iter().chain(h.to_array()).for_each(&mut add);
        back.iter().flat_map(|u| u.to_array()).for_each(&mut add);
    }
    // Made by this test on x86-64. Another value means other pictures: change it only with the formulas.
    assert_eq!(hash, 0xbe5e_d942_6e4d_1373, "FNV-1a of 10,000 points: {hash:#x}");
}

#[test]
#[should_panic(expected = "slices of lengths [3, 3, 2, 3]")]
fn unequal_lengths_are_refused() {
    let (x, mut u, mut v) = ([0.0; 3], [0.0; 2], [0.0; 3]);
    cosine_hemisphere_to_square_slice(&x, &x, &mut u, &mut v);
}
