//! All kernels give the same bits, whatever the scene, the resolution and the settings.

mod rooms;

use glam::Vec3A;
use radcache::{Record, RecordSettings};
use reproject::{Kernel, Settings, Workspace};
use rooms::{Rays, Scene, every_kind_of_record, every_setting, uniform};

/// All that a reprojection says, in bits.
#[derive(Debug, PartialEq)]
struct Answer {
    shares: [u32; 3],
    fill: Vec<u64>,
    unknown: Vec<u64>,
    mean: [u32; 3],
    owners: Vec<Option<usize>>,
    texture: Vec<[u32; 3]>,
}

fn answer(workspace: &mut Workspace, record: &Record, [p, n, ng]: [Vec3A; 3], settings: &Settings) -> Answer {
    let shares = workspace.project_above(record, p, n, ng, settings);
    let texels = workspace.resolution() * workspace.resolution();
    let mean = workspace.mean_radiance().to_array().map(f32::to_bits);
    let owners = (0..texels).map(|texel| workspace.owner(texel)).collect();
    let texture = workspace.texture(record).iter().map(|l| l.to_array().map(f32::to_bits)).collect();
    Answer {
        shares: [shares.filled, shares.unknown, shares.holes].map(f32::to_bits),
        fill: workspace.masks().fill.to_vec(),
        unknown: workspace.masks().unknown.to_vec(),
        mean,
        owners,
        texture,
    }
}

#[test]
fn every_kernel_matches_scalar() {
    let scenes = [Scene::cornell(), Scene::clutter(60), Scene::spheres(), Scene::yard()];
    let kernels: Vec<Kernel> = Kernel::ALL.into_iter().filter(|kernel| kernel.is_supported()).collect();
    let mut scalar = Workspace::with_kernel(Kernel::Scalar);
    // Kept over all cases: nothing may be left over from the one before.
    let mut others: Vec<Workspace> = kernels[1..].iter().map(|&kernel| Workspace::with_kernel(kernel)).collect();
    let mut unknown = 0;
    for (number, scene) in scenes.iter().enumerate() {
        for n in [1, 7, 16, 31, 32, 33, 64] {
            for place in 0..4u64 {
                let random = |k| uniform(1000 * number as u64 + 100 * place + k) - 0.5;
                let from = Vec3A::new(1.6 * random(0), 1.6 * random(1), -0.999);
                let record = every_kind_of_record(scene, from, n, place);
                let to = from + Vec3A::new(random(2), random(3), 0.1 * random(4)) * (1.5 * record.radius());
                let turned = Vec3A::new(random(5), random(6), 1.0).normalize();
                for [n, ng] in [[Vec3A::Z, Vec3A::Z], [turned, turned], [turned, Vec3A::Z]] {
                    for settings in every_setting() {
                        let expected = answer(&mut scalar, &record, [to, n, ng], &settings);
                        unknown += expected.unknown.iter().map(|row| row.count_ones()).sum::<u32>();
                        for other in &mut others {
                            let found = answer(other, &record, [to, n, ng], &settings);
                            assert!(found == expected, "{:?}, scene {number}, {settings:?}", other.kernel());
                        }
                    }
                }
            }
        }
    }
    assert!(unknown > 10_000, "the cases are not empty: {unknown}");
}

#[test]
fn hole_rays_do_not_depend_on_the_kernel() {
    let scene = Scene::clutter(60);
    let from = Vec3A::new(0.1, 0.05, -0.999);
    let record = rooms::record(|p, wi| scene.look(p, wi), from, Vec3A::Z, 32, &RecordSettings::default());
    let to = from + Vec3A::X * (0.5 * record.radius());
    let mut found = Vec::new();
    for kernel in Kernel::ALL.into_iter().filter(|kernel| kernel.is_supported()) {
        let mut workspace = Workspace::with_kernel(kernel);
        workspace.project(&record, to, Vec3A::Z, &Settings::default());
        let mut rays = Rays(to, |p, wi| scene.look(p, wi));
        let verdict = workspace.verify(&record, 4, 7, &mut rays);
        let count = workspace.trace_holes(2, 7, &mut rays);
        found.push((verdict, count, workspace.mean_radiance()));
    }
    assert!(found[0].1 > 10, "there are holes");
    assert!(found.iter().all(|answer| *answer == found[0]), "{found:?}");
}

#[test]
fn the_widest_kernel_is_taken() {
    let kernel = Workspace::new().kernel();
    assert!(kernel.is_supported());
    let wider = Kernel::ALL.into_iter().skip_while(|other| *other != kernel).skip(1);
    assert!(wider.into_iter().all(|other| !other.is_supported()), "{kernel:?} is not the widest");
    assert!(Kernel::Scalar.is_supported(), "everywhere");
}
