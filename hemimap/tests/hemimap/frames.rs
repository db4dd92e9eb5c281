//! Frames: orthonormal for every normal, and carried to a neighbour by the shortest rotation.

use crate::random::Random;
use hemimap::glam::{DQuat, DVec3, Vec3A};
use hemimap::{Frame, double};

/// The worst of all lengths, angles and the determinant of a frame, measured in f64.
fn defect(f: &Frame) -> f64 {
    let [s, t, n] = [f.s, f.t, f.n].map(|v| v.as_dvec3());
    let off = [s.length() - 1.0, t.length() - 1.0, s.dot(t), s.dot(n), t.dot(n), s.cross(t).dot(n) - 1.0];
    off.into_iter().fold(0.0, |worst, off| worst.max(off.abs()))
}

fn special() -> Vec<Vec3A> {
    let south = -1.0 + 1e-7f32;
    let rim = (1.0 - f64::from(south).powi(2)).sqrt() as f32;
    let mut normals = vec![Vec3A::new(rim, 0.0, south), Vec3A::new(0.0, -rim, south)];
    for axis in [Vec3A::X, Vec3A::Y, Vec3A::Z] {
        normals.extend([axis, -axis]);
    }
    normals.push(Vec3A::new(0.6, 0.8, -0.0));
    normals
}

#[test]
fn frames_are_orthonormal_for_every_normal() {
    let mut random = Random(1);
    let normals = (0..1_000_000).map(|_| random.direction().as_vec3a());
    for n in special().into_iter().chain(normals) {
        let frame = Frame::from_normal(n);
        assert!(defect(&frame) <= 4.0 * f64::from(f32::EPSILON), "{n}: {}", defect(&frame));
        assert_eq!(frame.n, n, "the normal is kept");
    }
}

#[test]
fn double_frames_are_orthonormal() {
    let mut random = Random(2);
    for n in special().into_iter().map(|n| n.as_dvec3().normalize()).chain((0..100_000).map(|_| random.direction())) {
        for f in [double::Frame::from_normal(n), double::Frame::from_normal(DVec3::Y).transported_to(n)] {
            let off = [f.s.length() - 1.0, f.t.length() - 1.0, f.s.dot(f.t), f.s.dot(n), f.s.cross(f.t).dot(n) - 1.0];
            // Twice the 4 eps of the f32 test: here the measuring itself rounds.
            assert!(off.iter().all(|off| off.abs() <= 8.0 * f64::EPSILON), "{n}: {off:?}");
            let v = DVec3::new(0.3, -2.0, 0.7);
            assert!((f.to_world(f.to_local(v)) - v).length() <= 1e-14, "{n}");
        }
    }
}

#[test]
fn local_and_world_are_inverse() {
    let mut random = Random(3);
    for _ in 0..100_000 {
        let frame = Frame::from_normal(random.direction().as_vec3a());
        let v = random.direction().as_vec3a();
        assert!((frame.to_world(frame.to_local(v)) - v).length() <= 1e-6, "{v}");
        assert!((frame.to_local(frame.to_world(v)) - v).length() <= 1e-6, "{v}");
        assert!((frame.to_world(Vec3A::Z) - frame.n).length() == 0.0, "z is the normal");
    }
}

#[test]
fn transport_is_the_shortest_rotation() {
    let mut random = Random(4);
    for _ in 0..200_000 {
        let (a, b) = (random.direction().as_vec3a(), random.direction().as_vec3a());
        let frame = Frame::from_normal(a);
        let moved = frame.transported_to(b);
        assert!(defect(&moved) <= 4.0 * f64::from(f32::EPSILON), "{a} -> {b}: {}", defect(&moved));
        // Naive twin: the quaternion of the shortest arc in f64; the sum a + b has lost digits near the opposite.
        let arc = DQuat::from_rotation_arc(a.as_dvec3().normalize(), b.as_dvec3().normalize());
        let bound = 2e-6 / f64::from((a + b).length());
        let off = (arc * frame.s.as_dvec3() - moved.s.as_dvec3()).length();
        assert!(off <= bound, "{a} -> {b}: {off}, bound {bound}");
    }
}

/// The same in f64, where the arc is known in closed form: a turn by pi - `rest` about a x `way`.
#[test]
fn double_transport_is_the_shortest_rotation() {
    let mut random = Random(6);
    for rest in [1e-12, 1e-7, 1e-3, 1.0, 2.0, 3.0f64] {
        for _ in 0..10_000 {
            let a = random.direction();
            let way = a.cross(random.direction()).normalize();
            let frame = double::Frame::from_normal(a);
            let moved = frame.transported_to(way * rest.sin() - a * rest.cos());
            let (axis, turned) = (a.cross(way), way * rest.cos() + a * rest.sin());
            let off = (axis * axis.dot(frame.s) - turned * way.dot(frame.s) - moved.s).length();
            assert!(off <= 4e-15 / rest.min(1.0), "{a}, {rest}: {off:e}");
        }
    }
}

/// The last sum of normals that still has a direction turns the tangent along it round; a new frame would not.
#[test]
fn transport_rotates_down_to_its_bound() {
    let n = Vec3A::new(16.0 * f32::EPSILON, 0.0, -1.0);
    assert_eq!(Frame::from_normal(Vec3A::Z).transported_to(n).s.x, -1.0, "f32");
    assert_eq!(Frame::from_normal(n).s.x, 1.0, "f32, a new frame");
    let n = DVec3::new(16.0 * f64::EPSILON, 0.0, -1.0);
    assert_eq!(double::Frame::from_normal(DVec3::Z).transported_to(n).s.x, -1.0, "f64");
    assert_eq!(double::Frame::from_normal(n).s.x, 1.0, "f64, a new frame");
}

#[test]
fn transport_near_the_opposite_normal_stays_a_frame() {
    let mut random = Random(5);
    let normals: Vec<_> = (0..100_000).map(|_| random.direction().as_vec3a()).collect();
    for n in special().into_iter().chain(normals) {
        let frame = Frame::from_normal(n);
        for step in [0.0, 1e-8, 1e-7, 3e-7, 1e-6, 2e-6, 1e-5, 1e-3] {
            let to = (-n.as_dvec3() + random.direction() * step).normalize().as_vec3a();
            let moved = frame.transported_to(to);
            assert!(defect(&moved) <= 4.0 * f64::from(f32::EPSILON), "{n}, {step}: {}", defect(&moved));
        }
    }
}

#[test]
fn transport_is_continuous_and_does_not_drift() {
    // Along a spiral that passes through both half spaces, where Duff's frame jumps.
    let normal = |k: u32| {
        let (polar, turn) = (f64::from(k) * 3e-5, f64::from(k) * 1e-3);
        DVec3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()).as_vec3a()
    };
    let mut frame = Frame::from_normal(normal(0));
    let first = frame;
    for k in 1..100_000 {
        let n = normal(k);
        let (next, straight) = (frame.transported_to(n), first.transported_to(n));
        // The step of the normal is below 1.1e-3; a transported tangent moves by no more.
        assert!((next.t - frame.t).length() <= 1.2e-3, "step {k}");
        assert!(defect(&next) <= 4.0 * f64::from(f32::EPSILON), "step {k}: {}", defect(&next));
        assert!(defect(&straight) <= 4.0 * f64::from(f32::EPSILON), "step {k}, in one go");
        frame = next;
    }
}
