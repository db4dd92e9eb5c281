//! What is wrong in a scene file is refused by file, line and field.

use crate::common::assert_refused;
use crate::{loaded, refused};

#[test]
fn faults_are_refused_by_line_and_field() {
    for (text, line, part) in [
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfovv = 3", 4, "unknown field 'fovv'; write 'fov'"),
        ("light = { point = { } }", 1, "light: one where a list is wanted; write it in brackets"),
        ("[light]\npoint = { }", 1, "[light] is the wrong kind of table; write [[light]]"),
        ("[[camera]]\neye = [0, 0, 1]\nat = [0, 0, 0]", 1, "[[camera]] is the wrong kind of table; write [camera]"),
        ("film = { exposure = 65 }", 1, "exposure: 65 is out of range"),
        ("[render]\nrecursive = true", 2, "unknown field 'recursive'"),
        ("[render]\nspp = \"recursion limit\"", 2, "spp: invalid type: string"),
        ("[kamera]\neye = [0, 0, 1]", 1, "unknown field 'kamera'; write 'camera'"),
        ("[camera]\neye = [0, 0, 1]", 1, "missing field `at`"),
        ("[film]\nsize = [0, 9]", 2, "size: 0 at index 0 is out of range; give numbers from 1.0 to 16384.0"),
        ("film = { size = [1000000000, 1] }", 1, "size: 1000000000 at index 0 is out of range"),
        ("film = { size = [16384, 16385] }", 1, "size: 16385 at index 1 is out of range"),
        ("film = { size = [1.5, 2] }", 1, "1.5 is not a whole number"),
        ("film = { size = 7 }", 1, "1 numbers where 2 are needed"),
        ("film = { exposure = nan }", 1, "exposure: NaN is out of range"),
        ("[render]\nspp = -1", 2, "spp: -1 is out of range; give numbers from 1.0 to 1048576.0"),
        ("[render]\nspp = 0", 2, "spp: 0 is out of range"),
        ("[render]\nspp = 1e12", 2, "spp: 1000000000000 is out of range"),
        ("[render]\nspp = 2.5", 2, "spp: 2.5 is not a whole number"),
        ("[render]\nspp = \"many\"", 2, "spp: invalid type: string \"many\""),
        ("[render]\nspp = 4\n\nspp = 5", 4, "duplicate key 'spp'; keep one"),
        ("[render]\nquality = inf", 2, "quality: inf is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfov = 0", 4, "fov: 0 is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfov = 180", 4, "fov: 180 is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nfov = nan", 4, "fov: NaN is out of range"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 1]", 1, "eye and at are the same point"),
        ("[camera]\neye = [0, 5, 0]\nat = [0, 0, 0]", 1, "up is parallel to the view"),
        ("[camera]\neye = [1.5e-5, 5, 0]\nat = [0, 0, 0]", 1, "up is parallel to the view"),
        ("[camera]\neye = [0, 0, 0]\nat = [1e-30, 0, 0]", 1, "eye and at are the same point"),
        ("[camera]\neye = [0, 5, 0]\nat = [0, 0, 0]\nup = [0, 0, 0]", 4, "a direction of length zero"),
        ("[camera]\neye = [0, 5]\nat = [0, 0, 0]", 2, "eye: 2 numbers where 3 are needed"),
        ("[camera]\neye = [0, 5, -.5]\nat = [0, 0, 0]", 2, "without a digit before its point; write 0.5 for .5"),
        ("[camera]\neye = [0, 5, +.5]\nat = [0, 0, 0]", 2, "without a digit before its point; write 0.5 for .5"),
        ("[camera]\neye = [0, .5, 1]\nat = [0, 0, 0]", 2, "without a digit before its point; write 0.5 for .5"),
        ("[camera]\neye = [0, 5, inf]\nat = [0, 0, 0]", 2, "eye: inf at index 2 is out of range"),
        ("camera = 3", 1, "camera: invalid type"),
        ("[[form]]\nquadric.coefficients = [1, 2, 3, 4, 5, 6, 7, 8, 9]", 2, "9 numbers where 10 are needed"),
        (
            "[[form]]\nquadric.coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
            2,
            "all ten coefficients of a quadric are zero",
        ),
        ("[[form]]\nquadric.coefficients = [0, 0, 0, 0, inf, 0, 0, 0, 0, 0]", 2, "inf at index 4 is out of range"),
        ("[[form]]\nquadric.coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, nan]", 2, "NaN at index 9 is out of range"),
        (
            "[[form]]\nquadric.elipsoid = { center = [0, 0, 0], radii = 1 }",
            2,
            "unknown field 'elipsoid'; write 'ellipsoid'",
        ),
        ("[[form]]\nquadric.sphere = { center = [0, 0, 0], radiu = 1 }", 2, "unknown field 'radiu'; write 'radius'"),
        ("[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 0 }", 2, "radius: 0 is out of range"),
        ("[[form]]\nname = \"x\"", 1, "a form without a quadric"),
        ("[[form]]\nunion = []", 1, "no parts in the union"),
        (
            "[[form]]\nname = \"apart\"\nintersection = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 } }, { quadric.sphere = { center = [3, 0, 0], radius = 1 } }]",
            1,
            "a form without inside",
        ),
        ("[[form]]\nquadric.coefficients = [-1, -1, -1, 0, 0, 0, 0, 0, 0, -1]", 1, "a form without inside"),
        ("[[form]]\ntext = \"ball(1)\"", 2, "line 1 of the text: "),
        ("[[form]]\ntext = \"\"\"\nunion(\nform(base 1 2)\n)\n\"\"\"", 2, "line 2 of the text: "),
        ("[[form]]\ntext = \"form(base 0 0 0 0 0 0 0 0 0 nan)\"", 2, "line 1 of the text: "),
        ("[[form]]\ntext = \"form(base 0 0 0 0 0 0 0 0 0 1)\"\nweight = 2", 1, "text beside a quadric"),
        ("[[form]]\nunion = [{ text = \"form(base 0 0 0 0 0 0 0 0 0 1)\", union = [] }]", 2, "text beside a quadric"),
        (
            "[[form]]\npsi = \"min\"\nunion = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 } }]",
            2,
            "unknown field 'min'",
        ),
        (
            "[[form]]\nunion = [\n{ quadric.sphere = { center = [0, 0, 0], radius = 1 } },\n{ },\n]",
            4,
            "a form without a quadric",
        ),
        ("[[form]]\ndifference = [\n]", 1, "no parts in the difference"),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nclip = { min = [0, 0, 0], max = [1, 0, 1] }",
            3,
            "a clip without inside",
        ),
        (
            "[[form]]\ncomplement = { quadric.sphere = { center = [0, 0, 0], radius = 1 } }\nunion = []",
            1,
            "both union and complement",
        ),
        (
            "[[form]]\npsi = { blend = { width = 0 } }\nunion = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 } }]",
            2,
            "width: 0 is out of range",
        ),
        (
            "[[form]]\nquadric.coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
            2,
            "all ten coefficients of a quadric are zero",
        ),
        ("[[form]]\nquadric.coefficients = [1, 0, 0, 0, nan, 0, 0, 0, 0, 0]", 2, "NaN at index 4 is out of range"),
        ("[[form]]\nscale = 0\nquadric.sphere = { center = [0, 0, 0], radius = 1 }", 2, "the scale is zero"),
        ("[[light]]\npoint = { position = [0, 0, 0], intensity = -1 }", 2, "intensity: -1 is out of range"),
        ("[[light]]\ndirectional = { direction = [0, 0, 0], irradiance = 1 }", 2, "a direction of length zero"),
        ("[[light]]\nspot = { }", 2, "unknown field 'spot'"),
        ("[[material]]\nname = \"a\"\nemission = [0, -1, 0]", 3, "emission: -1 at index 1 is out of range"),
        ("[[material]]\nname = \"a\"\ndiffuse = 2", 3, "diffuse: 2 is out of range; give numbers from 0.0 to 1.0"),
        (
            "[[material]]\nname = \"a\"\nmirror.reflectance = 1\nglass.ior = 1.5",
            2,
            "more than one of gloss, mirror and glass",
        ),
        ("[[material]]\nname = \"a\"\nglass.ior = 0", 3, "ior: 0 is out of range"),
        ("[[material]]\nname = \"a\"\nnoise.pattern = \"clouds\"", 3, "missing field `size`"),
        ("[[material]]\nname = \"a\"\nnoise = { pattern = \"cloud\", size = 1 }", 3, "write 'clouds'"),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = [1, 0, 1] }",
            3,
            "size: 0 at index 1 is out",
        ),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, octaves = 11 }",
            3,
            "octaves: 11 is out of",
        ),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, octaves = 1.5 }",
            3,
            "not a whole number",
        ),
        ("[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, low = 2 }", 3, "low: 2 is out of range"),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, distortion = inf }",
            3,
            "distortion: inf",
        ),
        (
            "[[material]]\nname = \"a\"\nnoise = { pattern = \"clouds\", size = 1, distortion = 1 }",
            3,
            "clouds with a dist",
        ),
        ("[[material]]\nname = \"a\"\nnoise = { pattern = \"wood\", size = 1, seed = 0.5 }", 3, "seed: invalid type"),
        ("[[form]]\nrepeat = { count = [1, 0, 1], step = [1, 1, 1] }", 2, "count: 0 at index 1 is out of range"),
        ("[[form]]\nrepeat = { count = [1, 1.5, 1], step = [1, 1, 1] }", 2, "count: 1.5 is not a whole number"),
        ("[[form]]\nrepeat = { count = [1, 1, 1] }", 2, "missing field `step`"),
        (
            "[[form]]\nrepeat = { count = [1, 1, 1], step = [1, 1, 1], size = [2, 1] }",
            2,
            "size: from 2 to 1; give the smaller",
        ),
        (
            "[[form]]\nrepeat = { count = [1, 1, 1], step = [1, 1, 1], sied = 1 }",
            2,
            "unknown field 'sied'; write 'seed'",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nrepeat = { count = [4194304, 4194304, 4194304], step = [1, 1, 1] }",
            3,
            "copies of free forms, more than the limit of 4194304; lower a count",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nrepeat = { count = [64, 1, 1], step = [1, 1, 1] }\n\
             [[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nrepeat = { count = [65536, 1, 64], step = [1, 1, 1] }",
            6,
            "4194368 copies of free forms, more than the limit of 4194304; lower a count",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nrepeat = { count = [101, 1, 1], step = [1e7, 1, 1] }",
            3,
            "repeated beyond the limit of 1e9 metres",
        ),
        (
            "[[form]]\nquadric.plane = { point = [0, 0, 0], normal = [0, 1, 0] }\nrepeat = { count = [1, 2, 1], step = [1, 1, 1] }",
            3,
            "an unbounded form repeated; clip it",
        ),
        (
            "[[form]]\nquadric.coefficients = [-1e-38, -1e-38, -1e-38, 0, 0, 0, 0, 0, 0, 1e38]",
            1,
            "a form that reaches beyond the limit of 1e9 metres",
        ),
        (
            "[[form]]\nscale = 1e6\nunion = [{ quadric.sphere = { center = [0, 0, 0], radius = 1 }, scale = 1e6 }]",
            1,
            "a form that reaches beyond the limit of 1e9 metres",
        ),
        (
            "[[form]]\ntranslate = [0, 0, -1e9]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }",
            1,
            "a form that reaches beyond the limit of 1e9 metres",
        ),
        ("[[form]]\nprojection.sphere = { }", 2, "unknown field 'sphere'; write 'spherical'"),
        ("[[form]]\nprojection.planar = { right = [1, 0, 0] }", 2, "missing field `up`"),
        ("[[form]]\nprojection.box = { size = 0 }", 2, "size: 0 is out of range"),
        ("[[form]]\nprojection.box = { size = 1, sise = 1 }", 2, "unknown field 'sise'; write 'size'"),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nprojection.planar = { right = [1, 0, 0], up = [-2, 0, 0] }",
            3,
            "right and up are parallel",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nprojection.spherical = { axis = [0, 0, 3] }",
            3,
            "front is parallel to the axis",
        ),
        (
            "[[form]]\nquadric.sphere = { center = [0, 0, 0], radius = 1 }\nprojection.spherical = { axis = [0, 0, 0] }",
            3,
            "a direction of length zero",
        ),
        ("[[material]]\nname = \"a\"\n[[material]]\nname = \"a\"", 4, "two materials 'a'"),
        ("[[material]]\ndiffuse = 0.5", 1, "missing field `name`"),
        ("[[material]]\nname = \"a\"\ndiffuse_texture = \"none.png\"", 3, "'none.png' cannot be read"),
        ("[[mesh]]\nfile = \"none.obj\"", 2, "'none.obj' cannot be read"),
        ("[[mesh]]\nfile = \".\"", 2, "is not a regular file"),
        ("[[mesh]]\nname = \"empty\"", 1, "a mesh without positions or faces"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2],\n[0, 1, 7]]",
            4,
            "face index 7 is out of range, there are 3",
        ),
        ("[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1]]", 3, "a face of 2 corners"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, -1, 2]]",
            3,
            "invalid value: integer `-1`",
        ),
        ("[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\nfaces = [[0, 1, 2]]", 1, "zero area"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\ntranslate = [1e8, 0, 0]",
            1,
            "rounded to zero area where they are moved to",
        ),
        ("[[mesh]]\npositions = [[0, 0, nan]]\nfaces = [[0, 0, 0]]", 2, "positions: NaN at index 2 is out of range"),
        (
            "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nuvs = [[0, 0]]\nfaces = [[0, 1, 2]]",
            1,
            "1 uvs for 3 positions",
        ),
        ("[[mesh]]\nmaterial = \"whit\"\n[[material]]\nname = \"white\"", 2, "no material 'whit'; write 'white'"),
        ("[environment]\nscale = 2", 1, "either file or radiance"),
        ("[environment]\nradiance = 1e20\nscale = 1e30", 1, "the environment times"),
        ("[environment]\nfile = \"none.exr\"", 2, "'none.exr' cannot be read"),
        ("include = [\n\"none.toml\",\n]", 2, "'none.toml"),
        ("version = 2", 1, "version 2 of the scene file, only 1 is known"),
        ("a = ", 1, ""),
        ("[camera\neye = 3", 1, "unclosed table"),
    ] {
        refused(text, line, part);
    }
    assert_refused(&[("a.toml", b"")], "a.toml: nothing to see", "");
    assert_refused(&[("a.toml", b"version = 1\n# \xff")], "a.toml:2: it is not text", "");
    assert_refused(&[("a.toml", &[0; 9])], "a.toml:1: ", "");
}

#[test]
fn forms_that_shine_are_bounded() {
    let lamp = "[[material]]\nname = \"lamp\"\nemission = 1\n";
    let form = |quadric: &str| format!("{lamp}[[form]]\nmaterial = \"lamp\"\nquadric = {{ {quadric} }}\n");
    refused(&form("half_space = { point = [0, 0, 0], normal = [0, 1, 0] }"), 4, "an unbounded form that shines");
    let ball = loaded(&form("sphere = { center = [0, 0, 0], radius = 1 }"));
    assert!(ball.description.environment.is_none(), "a shining ball is a light, no sky is needed");
}

#[test]
fn deep_nesting_is_refused() {
    let depth = 1_000_000;
    refused(&format!("a = {}", "[".repeat(depth)), 1, "nested too deep");
    refused(&format!("[[form]]\nunion = {}", "[{union=".repeat(depth)), 2, "nested too deep");
    refused(&format!("a{} = 1", ".a".repeat(depth)), 1, "nested too deep");
    let ball = "[{quadric.sphere={center=[0,0,0],radius=1}}]";
    let nested =
        |depth: usize| format!("[[form]]\nunion = {}{ball}{}\n", "[{union=".repeat(depth - 1), "}]".repeat(depth - 1));
    assert_eq!(loaded(&nested(32)).description.forms[0].solid.form_count(), 1, "32 unions");
    refused(&nested(33), 1, "set operations are nested deeper than 32");
}
