//! Light that comes straight from lamps: unbiased by every method.

use std::f64::consts::PI;

use freeform::{FreeForm, Psi, Quadric, Solid};
use glam::{DAffine3, DVec3, Vec2, Vec3};
use integrator::Method;
use scene::{Material, Projection, Texture};
use tests::{
    Builder, Effort, METHODS, film, icosphere, lambert, lamp, measure, mirror, polygon_irradiance, sphere_irradiance,
};

/// The half width of the floor on which light is measured, metres.
const FLOOR: f32 = 0.05;

/// A white floor around the origin and an eye beside its normal.
fn floor(normal: Vec3) -> Builder {
    let across = normal.any_orthonormal_vector();
    // The picture stays within the floor: 0.045 at a distance of 0.5 is 5 degrees.
    Builder::default().square(Vec3::ZERO, normal, FLOOR, lambert(1.0)).view(
        normal * 0.4 + across * 0.3,
        Vec3::ZERO,
        5.0,
    )
}

#[test]
fn irradiance_of_polygon_is_lamberts_formula() {
    // One-sided lamps shine down, on the floor.
    let above = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, y)| Vec3::new(x, y, 1.0));
    let upright = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| Vec3::new(0.5, -y, z));
    let triangle = [Vec3::new(1.0, 0.0, 1.0), Vec3::new(-1.0, -1.0, 2.0), Vec3::new(0.0, 1.0, 1.0)];
    let tilted = Vec3::new(0.75f32.sqrt(), 0.0, 0.5);
    let cases: [(&[Vec3], Vec3, &str); 5] = [
        (&above, Vec3::Z, "square above"),
        (&above, tilted, "square above a tilted floor"),
        (&above, Vec3::X, "square, half of it below the floor"),
        (&upright, Vec3::Z, "upright square, half of it below the floor"),
        (&triangle, Vec3::Z, "triangle"),
    ];
    for (corners, normal, what) in cases {
        let scene = floor(normal).polygon(corners, lamp(1.0)).build();
        let corners: Vec<DVec3> = corners.iter().map(|corner| corner.as_dvec3()).collect();
        let known = |p: DVec3| polygon_irradiance(&corners, p, normal.as_dvec3().normalize()) / PI;
        let effort = Effort { path_spp: 64, spp: 64, seeds: 2, ..Effort::default() };
        for method in METHODS {
            measure(&scene, method, &effort, known).assert_unbiased(what);
        }
    }
}

#[test]
fn irradiance_of_sphere_light_is_known_above_and_across_the_horizon() {
    // Radius 1 at distance h, w degrees from the normal. The form is sampled by the cone of its ball, in which nothing
    // misses.
    for (h, degrees, mesh_spp, form_spp) in
        [(2.0f32, 0.0f32, 128, 32), (2.0, 45.0, 256, 32), (2.0, 75.0, 512, 128), (2.0, 90.0, 512, 256)]
    {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let centre = Vec3::new(sin, 0.0, cos) * h;
        let of_form = |p: DVec3| sphere_irradiance(centre.as_dvec3(), 1.0, p, DVec3::Z) / PI;
        // Of a sphere of triangles each that looks at the floor is seen in full. At the horizon it has 0.2 % more than
        // a sphere.
        let (positions, triangles) = icosphere(centre, 1.0, 2);
        let of_mesh = |p: DVec3| {
            let sides = triangles.iter().map(|corners| {
                let corners = corners.map(|corner| positions[corner as usize].as_dvec3());
                let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                if normal.dot(p - corners[0]) > 0.0 { polygon_irradiance(&corners, p, DVec3::Z) } else { 0.0 }
            });
            sides.sum::<f64>() / PI
        };
        let form = floor(Vec3::Z).ball(centre, 1.0, lamp(1.0)).build();
        let mesh = floor(Vec3::Z).mesh((positions.clone(), triangles.clone()), lamp(1.0)).build();
        let knowns: [&dyn Fn(DVec3) -> f64; 2] = [&of_form, &of_mesh];
        for ((scene, spp, what), known) in
            [(form, form_spp, "free form"), (mesh, mesh_spp, "mesh")].into_iter().zip(knowns)
        {
            let what = format!("{what}, h = {h}, {degrees} degrees");
            let effort = Effort { path_spp: spp, spp, seeds: 2, direct_fit: false, ..Effort::default() };
            for method in METHODS {
                measure(&scene, method, &effort, known).assert_unbiased(&what);
            }
            let fitted = Effort { direct_fit: true, ..effort };
            let [plain, fitted] = [effort, fitted].map(|effort| measure(&scene, Method::Gather, &effort, known));
            let apart = fitted.mean - plain.mean;
            assert!(apart.abs() < 1e-4 && fitted.worst < 1.1 * plain.worst + 1e-4, "{what}: {fitted:?}, not {plain:?}");
        }
    }
}

#[test]
fn free_forms_that_fill_their_boxes_in_part_are_unbiased() {
    // A lamp that is a box, turned: the directions of the box around it are sampled, of which it fills some two thirds.
    // Of what it is made of no side is hidden by another, so that its irradiance is the sum over those that look at the
    // floor.
    let place = DAffine3::from_axis_angle(DVec3::new(1.0, 0.5, 0.3).normalize(), 0.7);
    let place = DAffine3::from_translation(DVec3::new(0.3, -0.2, 1.2)) * place;
    let half = DVec3::new(0.5, 0.3, 0.2);
    let solid = Solid::cuboid(-half, half).and_then(|solid| solid.transformed(&place)).expect("a box");
    let known = |p: DVec3| {
        let sides = (0..6).map(|side| {
            let (axis, sign) = (side / 2, if side % 2 == 0 { 1.0 } else { -1.0 });
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
                let mut corner = DVec3::ZERO;
                (corner[axis], corner[a], corner[b]) = (sign * half[axis], x * half[a], y * half[b]);
                place.transform_point3(corner)
            });
            let normal = place.matrix3.col(axis) * sign;
            if normal.dot(p - corners[0]) > 0.0 { polygon_irradiance(&corners, p, DVec3::Z) } else { 0.0 }
        });
        sides.sum::<f64>() / PI
    };
    let scene = floor(Vec3::Z).solid(solid, lamp(1.0)).build();
    for method in METHODS {
        let effort = Effort { path_spp: 128, spp: 128, seeds: 2, ..Effort::default() };
        measure(&scene, method, &effort, known).assert_unbiased("a turned box");
    }
}

/// A picture of which the lower half, v < 0.5, is `level` and the upper half black; the filter leaves an edge of a
/// thousandth.
fn half_picture(level: f32) -> Texture {
    // Rows are from above.
    Texture::from_linear(1, 1024, [[Vec3::ZERO; 512], [Vec3::splat(level); 512]].concat())
}

/// Checks a square lamp of which the half at y < 0 shines alone.
fn check_half_a_square(material: Material, level: f32) {
    let square = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)].map(|(x, y)| Vec3::new(x, y, 1.0));
    let half = [(-0.5, -0.5), (-0.5, 0.0), (0.5, 0.0), (0.5, -0.5)].map(|(x, y)| DVec3::new(x, y, 1.0));
    let mut builder = floor(Vec3::Z).polygon(&square, material);
    builder.description.textures.push(half_picture(level));
    let mesh = &mut builder.description.meshes[1];
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(0.5, 0.001 + 0.998 * (p.y + 0.5))).collect();
    mesh.uv_indices.clone_from(&mesh.triangles);
    let known = |x: f64, p: DVec3| polygon_irradiance(&half.map(|corner| corner + DVec3::X * x), p, DVec3::Z) / PI;
    let effort = Effort { path_spp: 256, spp: 256, seeds: 2, ..Effort::default() };
    let straight = builder.clone().build();
    assert!(straight.lights().count() >= 1, "it is sampled");
    // A mirror at x = -0.75, whose front looks along x, shows the lamp a second time, at x = -1.5.
    let mirrored = builder.square(Vec3::X * -0.75, Vec3::X, 100.0, mirror(1.0)).build();
    for method in METHODS {
        measure(&straight, method, &effort, |p| known(0.0, p)).assert_unbiased("straight");
        measure(&mirrored, method, &effort, |p| known(0.0, p) + known(-1.5, p)).assert_holds("by a mirror too");
    }
}

/// Checks a ball of which the half at y < 0 shines alone. The other half is black, or a hole through which one sees the
/// dark back of this one.
fn check_half_a_ball(material: Material, level: f32) {
    let (centre, radius) = (DVec3::new(0.0, 0.2, 1.0), 0.4);
    let mut builder = floor(Vec3::Z).ball(centre.as_vec3(), 0.4, material);
    builder.description.textures.push(half_picture(level));
    let height = DVec3::Y * 2.0;
    builder.description.forms[0].projection = Projection::planar(DVec3::Y * -1.0, DVec3::X, height);
    let scene = builder.build();
    assert_eq!(scene.lights().count(), 1, "it is sampled");
    let effort = Effort { path_spp: 256, spp: 256, seeds: 2, ..Effort::default() };
    for method in METHODS {
        measure(&scene, method, &effort, |p| half_ball(centre, radius, p)).assert_unbiased("half a ball");
    }
}

/// The share of the irradiance pi that the half at y < 0 of a ball of radiance 1 gives at `p` with the normal z: by the
/// midpoint rule over what is seen.
fn half_ball(centre: DVec3, radius: f64, p: DVec3) -> f64 {
    const STEPS: u32 = 200;
    let (offset, axis) = (centre - p, (centre - p).normalize());
    let (s, t) = axis.any_orthonormal_pair();
    let height = 1.0 - (1.0 - radius * radius / offset.length_squared()).sqrt();
    let step = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
    let directions = (0..STEPS * STEPS).map(|i| {
        let (cosine, angle) = (1.0 - height * step(i / STEPS), 2.0 * PI * step(i % STEPS));
        axis * cosine + (s * angle.cos() + t * angle.sin()) * (1.0 - cosine * cosine).sqrt()
    });
    let seen = directions.filter(|wi| {
        let along = wi.dot(offset);
        let way = along - (along * along - offset.length_squared() + radius * radius).max(0.0).sqrt();
        (p + *wi * way).y < 0.0
    });
    seen.map(|wi| wi.z).sum::<f64>() * 2.0 * height / f64::from(STEPS * STEPS)
}

#[test]
fn lamps_shine_through_their_masks() {
    check_half_a_square(Material { opacity_texture: Some(0), ..lamp(1.0) }, 1.0);
    check_half_a_ball(Material { opacity_texture: Some(0), ..lamp(1.0) }, 1.0);
}

#[test]
fn lamps_shine_by_their_textures() {
    check_half_a_square(Material { emission_texture: Some(0), ..lamp(0.125) }, 8.0);
    check_half_a_ball(Material { emission_texture: Some(0), ..lamp(0.125) }, 8.0);
}

#[test]
fn free_forms_that_are_there_in_part_shine_in_part() {
    // Of a ball a share o is seen. A hollow one shows the far side of its hollow, too, through what is not there of the
    // two surfaces before it.
    let (centre, opacity) = (Vec3::Z * 2.0, 0.4_f32);
    let lamp = || Material { opacity, ..lamp(1.0) };
    let ball = |radius| {
        let quadric = Quadric::sphere(centre.as_dvec3(), radius).expect("a sphere");
        Solid::from(FreeForm::new(quadric, vec![]).expect("a ball"))
    };
    let full = floor(Vec3::Z).ball(centre, 1.0, lamp()).build();
    let shell = Solid::difference(Psi::Maximum, vec![ball(1.0), ball(0.7)]).expect("a shell");
    let hollow = floor(Vec3::Z).solid(shell, lamp()).build();
    let opacity = f64::from(opacity);
    for (scene, inner, what) in [(full, 0.0, "ball"), (hollow, (1.0 - opacity).powi(2), "hollow ball")] {
        assert!(!scene.features().emissive_unsampled, "{what}: it is sampled");
        let known = |p: DVec3| {
            let ball = |radius| sphere_irradiance(centre.as_dvec3(), radius, p, DVec3::Z) / PI;
            opacity * (ball(1.0) + inner * ball(0.7))
        };
        for method in METHODS {
            let effort = Effort { path_spp: 256, spp: 256, seeds: 2, ..Effort::default() };
            measure(&scene, method, &effort, known).assert_unbiased(what);
        }
    }
}

#[test]
fn point_light_over_plane() {
    // E = I h / (h^2 + r^2)^1.5, without noise: a pixel averages over its width of 0.003, which changes 1e-5.
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 10.0, lambert(1.0))
        .point_light(Vec3::Z, 1.0)
        .view(Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 0.0), 3.0)
        .build();
    let known = |p: DVec3| (1.0 + p.x * p.x + p.y * p.y).powf(-1.5) / PI;
    for method in METHODS {
        let measured = measure(&scene, method, &Effort { seeds: 1, ..Effort::default() }, known);
        measured.assert_unbiased("point light");
        assert!((measured.mean - 1.0).abs() < 1e-4 && measured.worst < 5e-3, "no noise but that of the pixel");
    }
}

#[test]
fn tiny_light_near_a_surface_is_direct_alone() {
    // A disc of radius 1 mm, 1 cm above: E = pi L a^2 / (a^2 + h^2) below it; here a regular 64-gon.
    let (radius, height) = (1e-3, 1e-2);
    let corners: Vec<Vec3> = (0..64)
        .map(|i| {
            let (sin, cos) = (-std::f32::consts::TAU * i as f32 / 64.0).sin_cos();
            Vec3::new(radius * cos, radius * sin, height)
        })
        .collect();
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 1.0, lambert(0.5))
        .polygon(&corners, lamp(1.0))
        .view(Vec3::new(8e-3, 0.0, 8e-3), Vec3::ZERO, 2.0)
        .build();
    let corners: Vec<DVec3> = corners.iter().map(|corner| corner.as_dvec3()).collect();
    let known = |p: DVec3| 0.5 * polygon_irradiance(&corners, p, DVec3::Z) / PI;
    for method in METHODS {
        measure(&scene, method, &Effort::default(), known).assert_unbiased("tiny lamp");
    }
}

#[test]
fn fronts_do_not_light_their_own_backs() {
    // Points of the back are rounded: some lie in front of the plane, from where the lamp would fill the hemisphere.
    let (centre, normal) = (Vec3::new(1.37, -2.71, 3.3), Vec3::new(0.3, -0.4, 0.9).normalize());
    let frame = hemimap::Frame::from_normal(normal.into());
    let corner = |angle: f32| centre + 0.7 * Vec3::from(frame.s * angle.cos() + frame.t * angle.sin());
    let regular = |count: u32| -> Vec<Vec3> {
        (0..count).map(|i| corner(std::f32::consts::TAU * (i as f32 + 0.3) / count as f32)).collect()
    };
    // Two triangles that are a rectangle but for the last digit, in a plane through the origin.
    let bent = [(2.0, 0.0, 2.0), (2.0, 0.0, 3.0), (3.0, -1e-6, 3.0), (3.0, 0.0, 2.0)].map(Vec3::from).to_vec();
    let flat = [(3, "a triangle"), (4, "a square"), (7, "triangles side by side")];
    let lamps = flat.map(|(count, what)| (regular(count), centre, normal, what));
    let bent = (bent, Vec3::new(2.5, 0.0, 2.5), Vec3::Y, "a bent rectangle");
    for (front, centre, normal, what) in lamps.into_iter().chain([bent]) {
        let back: Vec<Vec3> = front.iter().rev().copied().collect();
        let seen = || Builder::default().view(centre - normal * 2.0, centre, 10.0);
        let white = Material { diffuse: Vec3::ONE, ..lamp(1.0) };
        let with_back = seen().polygon(&front, white);
        // Where the lamp is bent, a plate that is cut along the other diagonal would lie in front of it.
        let with_plate =
            (what != "a bent rectangle").then(|| seen().polygon(&front, lamp(1.0)).polygon(&back, lambert(1.0)));
        for scene in [with_back].into_iter().chain(with_plate).map(Builder::build) {
            for method in METHODS {
                let picture = film(&scene, method, &Effort::default(), 0).picture();
                assert!(
                    picture.iter().all(|&radiance| radiance == Vec3::ZERO),
                    "{what}, {method:?}: light on its back"
                );
            }
        }
    }
}
