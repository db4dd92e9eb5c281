//! Free forms against `fidget` in pictures of depth, and against `polycool` in roots, as tables in Markdown.
//!
//! `cargo run --release -p benches --example freeform_rivals`, on one thread.
//!
//! `fidget` meets no rays: it finds the first voxel of a grid whose middle is inside, by interval arithmetic over
//! octree cells and compiled code. So both make a picture of parallel rays from above; its depth is known to a voxel.
//! `polycool` finds roots of polynomials with given coefficients, which must be expanded first; both get the same
//! functions along a line, sums of two cubed quadratics and one quadratic.

use std::hint::black_box;
use std::time::Instant;

use benches::bodies::{body_name, bumpy, tree};
use fidget::context::Tree;
use fidget::jit::JitShape;
use fidget::render::{VoxelRenderConfig, VoxelSize};
use freeform::{FreeForm, Interval, Operation, Perturbation, Psi, Quadric, Ray, Solid};
use glam::DVec3;
use polycool::Poly;

/// Pixels across, and voxels deep.
const SIZE: u32 = 256;
/// Half the width of the picture, metres.
const REACH: f64 = 1.5;
/// Timings are the best of so many.
const RUNS: u32 = 3;

/// Returns the function of a quadric about `origin` as an expression.
fn quadric(quadric: &Quadric, origin: DVec3) -> Tree {
    let (x, y, z) = Tree::axes();
    // fidget looks at [-1, 1]^3.
    let (x, y, z) = (x * REACH - origin.x, y * REACH - origin.y, z * REACH - origin.z);
    let [a11, a22, a33, a12, a13, a23, a14, a24, a34, a44] = quadric.coefficients;
    let terms = [
        (a11, x.square()),
        (a22, y.square()),
        (a33, z.square()),
        (a12, x.clone() * y.clone()),
        (a13, x.clone() * z.clone()),
        (a23, y.clone() * z.clone()),
        (a14, x),
        (a24, y),
        (a34, z),
    ];
    let terms = terms.into_iter().filter(|(a, _)| *a != 0.0);
    terms.fold(Tree::constant(a44), |sum, (a, term)| sum + term * a)
}

fn form(form: &FreeForm) -> Tree {
    let base = quadric(form.base(), form.origin());
    form.perturbations().iter().fold(base, |sum, p| {
        let q = quadric(&p.quadric, form.origin()).max(0.0);
        sum + q.clone() * q.square() * p.factor
    })
}

/// Returns psi of two functions.
fn union(psi: Psi, f: Tree, g: Tree) -> Tree {
    match psi {
        Psi::Maximum => f.max(g),
        Psi::RFunction => f.clone() + g.clone() + (f.square() + g.square()).sqrt(),
        Psi::Blend { width } => {
            let near = (Tree::constant(1.0) - (f.clone() - g.clone()).abs() * width.recip()).max(0.0);
            f.max(g) + near.clone() * near.square() * (width / 6.0)
        }
    }
}

/// Returns the negative inside of a body of [`benches::bodies`]: a form, or the first of its leaves and every second
/// one, less the rest.
fn expression(solid: &Solid) -> Tree {
    let forms: Vec<Tree> = solid.forms().iter().map(form).collect();
    let inside = match solid.operation() {
        Some((Operation::Difference, psi)) => {
            // The union comes first in the order of forms: the body and half of the leaves.
            let (joined, taken) = forms.split_at(1 + forms.len() / 2);
            let body = joined.iter().cloned().reduce(|f, g| union(psi, f, g)).expect("a body");
            taken.iter().cloned().fold(body, |sum, g| union(psi, sum.neg(), g).neg())
        }
        _ => forms.into_iter().next().expect("one form"),
    };
    inside.neg()
}

/// Returns the least seconds of some runs, and what the last returned.
fn timed<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut best = f64::INFINITY;
    loop {
        let mut result = None;
        for _ in 0..RUNS {
            let start = Instant::now();
            result = Some(black_box(run()));
            best = best.min(start.elapsed().as_secs_f64());
        }
        if let Some(result) = result {
            return (best, result);
        }
    }
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn depth_pictures() {
    println!(
        "| body | seconds to make, by us | by fidget | pixels/s by us | by fidget | times | pixels that only one has | depth that differs by more than a voxel |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let bodies = [0, 1, 8, 64, 512].map(|n| (body_name(n), bumpy(n)));
    let trees = [2, 10, 100].map(|n| (format!("tree of {n} leaves"), tree(n, Psi::Maximum)));
    let blends = [2, 10, 100].map(|n| (format!("blend of {n} leaves"), tree(n, Psi::Blend { width: 0.2 })));
    let voxel = 2.0 * REACH / f64::from(SIZE);
    // Middles of pixels as fidget has them: the first column on the left edge, the first row a pixel below the upper.
    let at = |i: u32| REACH * (2.0 * f64::from(i) / f64::from(SIZE) - 1.0);
    for (name, solid) in bodies.into_iter().chain(trees).chain(blends) {
        let text = solid.to_string();
        let (our_making, solid) = timed(|| text.parse::<Solid>().expect("text is read back"));
        let (ours, depths) = timed(|| -> Vec<Option<f64>> {
            let pixels = (0..SIZE * SIZE).map(|k| DVec3::new(at(k % SIZE), -at(k / SIZE + 1), REACH));
            pixels.map(|eye| solid.first_hit(&Ray::new(eye, -DVec3::Z)).map(|hit| REACH - hit.t)).collect()
        });
        let (their_making, shape) = timed(|| JitShape::from(expression(&solid)));
        let config = VoxelRenderConfig { image_size: VoxelSize::from(SIZE), threads: None, ..Default::default() };
        let (theirs, picture) = timed(|| config.run(shape.clone()).expect("not cancelled").0);
        let (mut alone, mut off) = (0, 0);
        for (k, depth) in (0..).zip(&depths) {
            let voxels = picture[(k / SIZE as usize, k % SIZE as usize)];
            match (depth, voxels) {
                (Some(z), 1..) => {
                    let found = at(voxels);
                    off += u32::from((z - found).abs() > 1.01 * voxel);
                }
                (None, 0) => {}
                _ => alone += 1,
            }
        }
        let count = f64::from(SIZE * SIZE);
        println!(
            "| {name} | {our_making:.1e} | {their_making:.1e} | {:.2e} | {:.2e} | {:.2} | {alone} | {off} |",
            count / ours,
            count / theirs,
            theirs / ours
        );
    }
}

/// Numbers in [-1, 1) by SplitMix64.
struct Random(u64);

impl Random {
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// F + f Q^3 + g R^3 on [-1, 1], where Q and R are positive; quadratics as [a, b, c].
#[derive(Clone, Copy)]
struct Piece {
    base: [f64; 3],
    cubes: [([f64; 3], f64); 2],
}

impl Piece {
    /// A base through three points of the cubes, so that there are three roots at least.
    fn crossed(random: &mut Random, nearness: f64) -> Self {
        let mut bump = || {
            let middle = 0.4 * random.signed();
            let reach = 1.5 + middle.abs() + 0.5 * random.signed();
            [-1.0, 2.0 * middle, reach * reach - middle * middle]
        };
        let (q, r) = (bump(), bump());
        let cube = |q: [f64; 3], x: f64| (x * (q[0] * x + q[1]) + q[2]).powi(3);
        let g = -cube(q, 0.0) / cube(r, 0.0) * (1.0 + 0.5 * random.signed());
        let middle = 0.8 * random.signed();
        let x =
            [middle, middle + nearness * (1.0 + 0.5 * random.signed()), -0.7 * middle.signum() + 0.2 * random.signed()];
        let y = x.map(|x| -cube(q, x) - g * cube(r, x));
        let first = (y[1] - y[0]) / (x[1] - x[0]);
        let a = ((y[2] - y[1]) / (x[2] - x[1]) - first) / (x[2] - x[0]);
        let b = first - a * (x[0] + x[1]);
        Self { base: [a, b, y[0] - x[0] * (b + a * x[0])], cubes: [(q, 1.0), (r, g)] }
    }

    fn solid(&self) -> Solid {
        let along_x = |[a, b, c]: [f64; 3]| Quadric { coefficients: [a, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, 0.0, c] };
        let perturbations = self.cubes.map(|(q, factor)| Perturbation { quadric: along_x(q), factor });
        FreeForm::new(along_x(self.base), perturbations.to_vec()).expect("sound").into()
    }

    /// Coefficients of powers, the lowest first.
    fn expanded(&self) -> [f64; 7] {
        let mut sum = [0.0; 7];
        for (k, c) in self.base.iter().rev().enumerate() {
            sum[k] = *c;
        }
        for ([a, b, c], f) in self.cubes {
            let square = [c * c, 2.0 * b * c, b * b + 2.0 * a * c, 2.0 * a * b, a * a];
            for (i, s) in square.into_iter().enumerate() {
                for (j, q) in [c, b, a].into_iter().enumerate() {
                    sum[i + j] += f * s * q;
                }
            }
        }
        sum
    }

    fn value(&self, x: f64) -> f64 {
        let at = |[a, b, c]: [f64; 3]| x * (a * x + b) + c;
        self.cubes.iter().fold(at(self.base), |sum, &(q, f)| sum + f * at(q).powi(3))
    }

    /// Whether the sign changes between any two neighbours of the roots, clearly above rounding: then all of them are.
    fn confirms(&self, roots: &[f64]) -> bool {
        let ends = std::iter::once(-1.0).chain(roots.iter().copied()).chain(std::iter::once(1.0));
        let ends: Vec<f64> = ends.collect();
        let values: Vec<f64> = ends.windows(2).map(|pair| self.value(0.5 * (pair[0] + pair[1]))).collect();
        values.windows(2).all(|pair| pair[0] * pair[1] < 0.0 && pair[0].abs().min(pair[1].abs()) > 1e-13)
    }
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn roots() {
    println!(
        "| two roots about | functions/s by us | by polycool | roots that both have | only we, confirmed | only polycool, confirmed | unconfirmed |"
    );
    println!("|---|---|---|---|---|---|---|");
    const COUNT: u32 = 100_000;
    let line = Ray::line(DVec3::ZERO, DVec3::X).between(-1.0, 1.0);
    for nearness in [0.5, 1e-2, 1e-4, 1e-6] {
        let mut random = Random(1);
        let pieces: Vec<Piece> = (0..COUNT).map(|_| Piece::crossed(&mut random, nearness)).collect();
        let solids: Vec<Solid> = pieces.iter().map(Piece::solid).collect();
        let polynomials: Vec<[f64; 7]> = pieces.iter().map(Piece::expanded).collect();
        let mut inside: Vec<Interval> = Vec::new();
        let (ours, found) = timed(|| -> Vec<Vec<f64>> {
            let roots = |solid: &Solid| {
                solid.intervals(&line, &mut inside);
                inside.iter().flat_map(|i| [i.t_in, i.t_out]).filter(|t| t.abs() < 1.0).collect()
            };
            solids.iter().map(roots).collect()
        });
        let (theirs, given) = timed(|| -> Vec<Vec<f64>> {
            polynomials.iter().map(|c| Poly::new(*c).roots_between(-1.0, 1.0, 1e-14).to_vec()).collect()
        });
        let (mut both, mut we, mut they, mut neither) = (0, 0, 0, 0);
        for ((piece, a), b) in pieces.iter().zip(&found).zip(&given) {
            both += a.len().min(b.len());
            let (more, count) = if a.len() > b.len() { (a, &mut we) } else { (b, &mut they) };
            let differ = a.len().abs_diff(b.len());
            *if piece.confirms(more) { count } else { &mut neither } += differ;
        }
        let rate = |seconds: f64| f64::from(COUNT) / seconds;
        println!("| {nearness:.0e} | {:.2e} | {:.2e} | {both} | {we} | {they} | {neither} |", rate(ours), rate(theirs));
    }
}

#[expect(clippy::print_stdout, reason = "the tables are the result")]
fn main() {
    depth_pictures();
    println!();
    roots();
}
