//! MTL libraries: values out of their domain are refused by line, the rest means what docs/materials.md says.

mod common;

use common::{assert_refused, load_files};
use scene::glam::Vec3;
use scene::{Loaded, Material, SpecularKind};

const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";

fn loaded(lines: &str) -> Loaded {
    let mtl = format!("newmtl m\n{lines}\n");
    load_files(&[("a.obj", OBJ), ("a.mtl", mtl.as_bytes())])
        .unwrap_or_else(|error| panic!("{lines:?} is refused: {error}"))
}

fn material(lines: &str) -> Material {
    loaded(lines).description.materials[0].clone()
}

#[test]
fn values_out_of_their_domain_are_refused_by_line() {
    let table: &[(&str, usize, &str)] = &[
        ("Kd 2 2 2", 2, "Kd 2 is out of range; give a number from 0 to 1"),
        ("Ks 0 0 1.5", 2, "Ks 1.5 is out of range"),
        ("illum 2\nKd -1 0 0", 3, "Kd -1 is out of range"),
        ("Ke nan 0 0", 2, "Ke nan is out of range; give a finite number"),
        ("Ke -1 0 0", 2, "at least 0"),
        ("Ke 1e39", 2, "give a finite number"),
        ("Kd 0.5 0.5", 2, "Kd has 2 numbers"),
        ("Kd", 2, "Kd has 0 numbers"),
        ("Kd red", 2, "'red' of Kd is not a number"),
        ("Ns -5", 2, "Ns -5 is out of range"),
        ("Pr 2", 2, "Pr 2 is out of range"),
        ("Pm -0.1", 2, "Pm -0.1 is out of range"),
        ("d 1.5", 2, "d 1.5 is out of range"),
        ("Tr nan", 2, "Tr nan"),
        ("Tf 1 1 7", 2, "Tf 7"),
        ("illum 7\nNi 0", 3, "Ni 0 is no refractive index"),
        ("Ni -1\nillum 4", 2, "Ni -1 is no refractive index"),
        ("illum 9\nNi 1e9", 3, "is no refractive index"),
        ("map_Kd none.png", 2, "'none.png' cannot be read"),
        ("\nmap_d none.png", 3, "'none.png' cannot be read"),
    ];
    for (lines, line, part) in table {
        let mtl = format!("newmtl m\n{lines}\n");
        assert_refused(&[("a.obj", OBJ), ("a.mtl", mtl.as_bytes())], &format!("a.mtl:{line}: "), part);
    }
}

#[test]
fn odd_and_right_values_load() {
    assert_eq!(material("Ke 1e30").emission, Vec3::splat(1e30), "very bright");
    assert_eq!(material("d 0").opacity, 0.0, "not there");
    assert_eq!(material("d -halo 0.5").opacity, 0.5, "halo");
    let gloss = material("Kd 1 1 1\nKs 0.04 0.04 0.04\nNs 198\nNi 1.5");
    assert_eq!((gloss.diffuse, gloss.name.as_str()), (Vec3::ONE, "m"), "the layered material keeps its own energy");
    assert!(matches!(gloss.specular, SpecularKind::Ggx { schlick: false, .. }), "{:?}", gloss.specular);
}

#[test]
fn what_is_not_used_is_warned_of() {
    let warns = |lines: &str, part: &str| {
        let loaded = loaded(lines);
        assert!(
            loaded.warnings.iter().any(|warning| warning.contains(part)),
            "wanted {part:?} in {:?}",
            loaded.warnings
        );
    };
    warns("Ni -1", "Ni out of range is not used");
    warns("d 0.5\nTr 0.9", "d and Tr are at odds");
    warns("map_Bump a.png\nmap_Bump b.png", "map_Bump is not used (2 times)");
    warns("Kd spectral a.rfl", "spectrum");
    warns("Kd 0.1\nnewmtl m\nKd 0.2", "defined twice, the last is taken: 'm'");
    warns("illum 7\nNi 1.5\nPr 0.2", "rough glass");
    warns("Ks 0\nmap_Ks none.png", "a.mtl:3: map_Ks is multiplied by Ks, which is 0");
    warns("Pm 1\nKs 0.9\nmap_Kd none.png", "a.mtl:4: map_Kd is not used, as the metal has the colour of Ks");
    warns("Ke 0\nmap_Ke none.png", "a.mtl:3: map_Ke is multiplied by Ke, which is 0");
    assert_eq!(material("Kd 0.1\nnewmtl m\nKd 0.2").diffuse, Vec3::splat(0.2), "the last wins");
    assert!(loaded("Ka 1 1 1\nKd 0.5\nd 0.25\nTr 0.75").warnings.is_empty(), "d and Tr agree");
}

#[test]
fn hostile_libraries_are_refused() {
    assert_refused(&[("a.obj", OBJ), ("a.mtl", &[0; 10])], "a.mtl:1: it is not text", "");
    let name = format!("newmtl {}", "n".repeat(5000));
    assert_refused(&[("a.obj", OBJ), ("a.mtl", name.as_bytes())], "a.mtl:1: a name of", "limit of 4096");
    let many: String = (0..65_537).map(|i| format!("newmtl {i}\n")).collect();
    assert_refused(&[("a.obj", OBJ), ("a.mtl", many.as_bytes())], "a.mtl:65537: more than 65536 materials", "");
    assert_refused(
        &[("a.obj", b"mtllib .\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")],
        "a.obj:1: ",
        "is not a regular file",
    );
}

#[test]
fn glass_needs_none_of_its_pictures() {
    let glass = material("illum 7\nNi 1.5\nmap_Kd none.png\nmap_d none.png");
    assert!(matches!(glass.specular, SpecularKind::Dielectric { .. }), "{:?}", glass.specular);
    assert_eq!((glass.diffuse_texture, glass.opacity_texture), (None, None), "nothing shows them");
}

#[test]
fn a_thousand_libraries_are_read_and_no_more() {
    let obj = |count: usize| {
        // The first is named again at the end, which counts for nothing.
        let names: String = (0..count).chain([0]).map(|i| format!("mtllib {i}.mtl\n")).collect();
        format!("{names}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    };
    assert!(load_files(&[("a.obj", obj(1000).as_bytes())]).is_ok(), "as many as are allowed");
    assert_refused(&[("a.obj", obj(1001).as_bytes())], "a.obj:1001: more than 1000 material libraries", "join them");
}
