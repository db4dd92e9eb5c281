//! Meshes of solids: closed, turned outwards and near to what they show.

use std::collections::HashMap;

use freeform::{FreeForm, MeshError, Perturbation, Psi, Quadric, Solid, SurfaceMesh};
use glam::{DAffine3, DVec3};

fn ball(center: DVec3, radius: f64) -> Solid {
    FreeForm::new(Quadric::sphere(center, radius).expect("a ball"), vec![]).expect("sound").into()
}

/// Every edge belongs to two triangles that run along it in opposite directions, and the triangles about each vertex
/// are one fan.
fn assert_manifold(mesh: &SurfaceMesh, name: &str) {
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for (from, to, apex) in [(*a, *b, *c), (*b, *c, *a), (*c, *a, *b)] {
            assert_eq!(edges.insert((from, to), apex), None, "{name}: edge {from} {to} is run along twice");
        }
    }
    let mut fans = vec![0_u32; mesh.positions.len()];
    for (from, to) in edges.keys() {
        assert!(edges.contains_key(&(*to, *from)), "{name}: edge {from} {to} has one side");
        fans[*from as usize] += 1;
    }
    // Going round a vertex from triangle to triangle comes by all of them.
    let mut start = vec![None; mesh.positions.len()];
    edges.keys().for_each(|(from, to)| start[*from as usize] = Some(*to));
    for (vertex, (start, fan)) in (0_u32..).zip(start.into_iter().zip(fans)) {
        let start = start.expect("every vertex is used");
        let (mut at, mut steps) = (start, 0);
        loop {
            at = edges[&(vertex, at)];
            steps += 1;
            if at == start {
                break;
            }
        }
        assert_eq!(steps, fan, "{name}: the triangles at vertex {vertex} are one fan");
    }
}

fn volume(mesh: &SurfaceMesh) -> f64 {
    let p = |corner: u32| mesh.positions[corner as usize];
    mesh.triangles.iter().map(|[a, b, c]| p(*a).dot(p(*b).cross(p(*c))) / 6.0).sum()
}

#[test]
fn a_ball_becomes_a_closed_mesh_near_to_it() {
    let solid = ball(DVec3::new(0.3, -0.2, 0.1), 1.0);
    for (cell, faces) in [(0.5, 50), (0.1, 2000), (0.05, 10_000)] {
        let mesh = solid.to_mesh(cell).unwrap();
        assert_manifold(&mesh, "ball");
        assert!(mesh.triangles.len() > faces, "{} triangles of cells of {cell}", mesh.triangles.len());
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            let v = *p - DVec3::new(0.3, -0.2, 0.1);
            assert!((v.length() - 1.0).abs() < 3e-6 * cell, "vertex {p} is on the surface");
            assert!((v - *n).length() < 1e-5, "with its normal {n}");
        }
        for triangle in &mesh.triangles {
            let middle = triangle.iter().map(|corner| mesh.positions[*corner as usize]).sum::<DVec3>() / 3.0;
            let off = (middle - DVec3::new(0.3, -0.2, 0.1)).length() - 1.0;
            // A chord as long as a cube's diagonal is 3 cell^2 / 8 below the arc.
            assert!(off <= 1e-6 && off > -0.4 * cell * cell, "the middle of a triangle is {off} off");
        }
        let ball = 4.0 / 3.0 * std::f64::consts::PI;
        assert!((volume(&mesh) / ball - 1.0).abs() < 0.5 * cell * cell, "volume {} of {ball}", volume(&mesh));
    }
}

#[test]
fn trees_and_blends_become_manifolds() {
    let dent = Perturbation { quadric: Quadric::sphere(DVec3::Z, 0.7).unwrap(), factor: -1.5 };
    let apple: Solid = FreeForm::new(Quadric::sphere(DVec3::ZERO, 1.0).unwrap(), vec![dent]).unwrap().into();
    let hole: Solid = FreeForm::new(Quadric::cylinder(DVec3::ZERO, DVec3::Y, 0.3).unwrap(), vec![]).unwrap().into();
    let cube = Solid::cuboid(DVec3::splat(-0.8), DVec3::splat(0.8)).unwrap();
    let bored = Solid::difference(Psi::Maximum, vec![apple.clone(), hole.clone()]).unwrap();
    let rounded = Solid::difference(Psi::Blend { width: 0.2 }, vec![cube.clone(), hole]).unwrap();
    let molten = Solid::union(Psi::Blend { width: 0.3 }, vec![apple.clone(), ball(DVec3::X * 1.2, 0.4)]).unwrap();
    // Faces of the cube that lie in the planes of the grid.
    for (name, solid, cell) in [
        ("apple", &apple, 0.13),
        ("bored", &bored, 0.07),
        ("rounded", &rounded, 0.1),
        ("molten", &molten, 0.1),
        ("cube", &cube, 0.1),
    ] {
        let mesh = solid.to_mesh(cell).unwrap();
        assert_manifold(&mesh, name);
        assert!(mesh.triangles.len() > 100, "{name}: {} triangles", mesh.triangles.len());
        assert!(volume(&mesh) > 0.5, "{name}: turned outwards, volume {}", volume(&mesh));
        for p in &mesh.positions {
            let off = solid.value(*p).abs() / solid.gradient(*p).length().max(1e-3);
            assert!(off < 1e-3 * cell, "{name}: vertex {p} is {off} off");
        }
    }
}

#[test]
fn what_has_no_mesh_is_refused() {
    let rod: Solid = FreeForm::new(Quadric::cylinder(DVec3::ZERO, DVec3::Y, 0.3).unwrap(), vec![]).unwrap().into();
    assert_eq!(rod.to_mesh(0.1), Err(MeshError::Unbounded), "a cylinder");
    let solid = ball(DVec3::ZERO, 1.0);
    for cell in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(solid.to_mesh(cell), Err(MeshError::Cell), "a cell of {cell}");
    }
    assert!(matches!(solid.to_mesh(1e-9), Err(MeshError::TooFine(_))), "too fine");
    // Few cells, but the corners of a layer would fill the memory.
    let plate = Solid::cuboid(DVec3::new(-1000.0, -1000.0, -0.01), DVec3::new(1000.0, 1000.0, 0.01)).unwrap();
    assert!(matches!(plate.to_mesh(0.05), Err(MeshError::TooFine(cells)) if cells < 1e10), "too fine a layer");
    let thread = Solid::cuboid(DVec3::splat(-0.01), DVec3::new(1e7, 0.01, 0.01)).unwrap();
    assert!(matches!(thread.to_mesh(0.05), Err(MeshError::TooFine(_))), "or too long a row");
    let nothing = Solid::intersection(Psi::Maximum, vec![ball(DVec3::ZERO, 1.0), ball(DVec3::X * 5.0, 1.0)]).unwrap();
    assert_eq!(nothing.to_mesh(0.1), Ok(SurfaceMesh::default()), "nothing has no triangles");
}

#[test]
fn obj_counts_from_what_stands_before() {
    let mesh = ball(DVec3::ZERO, 1.0).to_mesh(0.9).unwrap();
    let mut text = Vec::new();
    mesh.write_obj("ball", [7, 0], &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let count = |start: &str| text.lines().filter(|line| line.starts_with(start)).count();
    assert_eq!(
        (count("v "), count("vn "), count("f ")),
        (mesh.positions.len(), mesh.normals.len(), mesh.triangles.len()),
        "{text}"
    );
    let least = text.lines().filter(|line| line.starts_with("f ")).flat_map(|line| line[2..].split(' '));
    let least: Option<usize> = least.filter_map(|word| word.split('/').next()?.parse().ok()).min();
    assert_eq!(least, Some(8), "the first vertex");
}

#[test]
fn texture_coordinates_run_on_across_the_seam() {
    let solid = ball(DVec3::ZERO, 1.0);
    let mesh = solid.to_mesh(0.1).unwrap().with_texture_coordinates(true, |p, _| solid.texture_coordinates(p));
    assert_eq!(mesh.uv_triangles.len(), mesh.triangles.len(), "for every triangle");
    let mut beyond = 0;
    for (corners, uvs) in mesh.triangles.iter().zip(&mesh.uv_triangles) {
        let [a, b, c] = uvs.map(|uv| mesh.uvs[uv as usize].x);
        // Meridians run together in the poles.
        if corners.iter().any(|corner| mesh.positions[*corner as usize].y.abs() > 0.95) {
            continue;
        }
        assert!(a.max(b).max(c) - a.min(b).min(c) <= 0.5, "no triangle holds the whole picture: {a} {b} {c}");
        for (corner, uv) in corners.iter().zip(uvs) {
            let (found, expected) =
                (mesh.uvs[*uv as usize], solid.texture_coordinates(mesh.positions[*corner as usize]));
            let turns = found.x - expected.x;
            assert!((turns - turns.round()).abs() < 1e-15 && found.y == expected.y, "{found} instead of {expected}");
            beyond += usize::from(turns.abs() > 0.5);
        }
    }
    assert!(beyond > 10, "some lie across: {beyond}");
    let mirrored = mesh.transformed(&DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    for (index, [a, b, c]) in mesh.uv_triangles.iter().enumerate() {
        assert_eq!(mirrored.uv_triangles[index], [*a, *c, *b], "turned with their triangle");
        let [p, q, r] = mesh.triangles[index];
        assert_eq!(mirrored.triangles[index], [p, r, q], "as it is");
    }
}
