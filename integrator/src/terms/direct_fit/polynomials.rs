//! Quadratic polynomials of the place in a window of pixels, fitted in the least squares.

/// Points along a side of the greatest window, the pixel in the middle of it.
pub(super) const SIDE: usize = 7;
pub(super) const RADIUS: usize = SIDE / 2;
/// Half of the sides of windows without the pixel in the middle, the widest first.
pub(super) const RADII: [usize; 2] = [RADIUS, RADIUS - 1];
/// Points along a row of a window, of which the last one is not part of it.
pub(super) const LANES: usize = 8;
/// Fewer points tell too little of whether a polynomial is right.
const MIN_POINTS: f32 = 14.0;
/// A polynomial that leaves so many times the variance that the halves of samples show is wrong. They show up to twice
/// what there is, so that few right ones are refused. In spot (6 pictures at quality 1, plain relMSE) direct light keeps
/// 2.0e-5 of 4.5e-5 of noise with 1, and its bias is 0.4e-6, by squares; with 1.4 they are 1.7e-5 and 1.2e-6.
const MISFIT: f32 = 1.2;
/// Points of which a term has less than this share that others do not have lie along a line, or nearly so.
const DEGENERATE: f64 = 1e-4;
/// Terms of a polynomial, and the pairs of them.
const TERMS: usize = 6;
const PAIRS: usize = TERMS * (TERMS + 1) / 2;

/// One number for each point of a window.
pub(super) type Window = [[f32; LANES]; SIDE];

/// The terms of a polynomial, 1, x, y, x^2, xy and y^2, where the window is 2 wide.
const BASIS: [Window; TERMS] = basis();
/// The products of all pairs of them, row by row of the lower half of their matrix.
const PRODUCTS: [Window; PAIRS] = products();
/// Which points belong to a window of each of the radii.
pub(super) const INSIDE: [Window; RADII.len()] = [inside(RADII[0]), inside(RADII[1])];

const fn basis() -> [Window; TERMS] {
    let mut basis = [[[0.0; LANES]; SIDE]; TERMS];
    let mut row = 0;
    while row < SIDE {
        let mut lane = 0;
        while lane < LANES {
            let x = lane as f32 / RADIUS as f32 - 1.0;
            let y = row as f32 / RADIUS as f32 - 1.0;
            let terms = [1.0, x, y, x * x, x * y, y * y];
            let mut term = 0;
            while term < TERMS {
                basis[term][row][lane] = terms[term];
                term += 1;
            }
            lane += 1;
        }
        row += 1;
    }
    basis
}

const fn products() -> [Window; PAIRS] {
    let mut products = [[[0.0; LANES]; SIDE]; PAIRS];
    let (mut i, mut pair) = (0, 0);
    while i < TERMS {
        let mut j = 0;
        while j <= i {
            let mut at = 0;
            while at < SIDE * LANES {
                let (row, lane) = (at / LANES, at % LANES);
                products[pair][row][lane] = BASIS[i][row][lane] * BASIS[j][row][lane];
                at += 1;
            }
            (j, pair) = (j + 1, pair + 1);
        }
        i += 1;
    }
    products
}

const fn inside(radius: usize) -> Window {
    let mut inside = [[0.0; LANES]; SIDE];
    let mut row = RADIUS - radius;
    while row <= RADIUS + radius {
        let mut lane = RADIUS - radius;
        while lane <= RADIUS + radius {
            inside[row][lane] = 1.0;
            lane += 1;
        }
        row += 1;
    }
    inside
}

pub(super) fn product(a: &Window, b: &Window) -> Window {
    let mut product = *a;
    for (a, b) in product.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
        *a *= b;
    }
    product
}

/// Sum over the products of two windows, lane by lane.
pub(super) fn dot(a: &Window, b: &Window) -> f32 {
    let mut lanes = [0.0; LANES];
    for row in 0..SIDE {
        for lane in 0..LANES {
            lanes[lane] += a[row][lane] * b[row][lane];
        }
    }
    lanes.into_iter().sum()
}

/// The least squares of polynomials over points that count differently: the lower triangular root of the matrix of the
/// products of their terms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polynomials([[f64; TERMS]; TERMS]);

impl Polynomials {
    /// `None` where points are too few to tell whether a polynomial is right, or lie along a line, so that many fit.
    pub(super) fn new(weights: &Window) -> Option<Self> {
        if count(weights) < MIN_POINTS {
            return None;
        }
        let mut root = [[0.0; TERMS]; TERMS];
        let mut pairs = PRODUCTS.iter();
        for i in 0..TERMS {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
                let whole = f64::from(dot(weights, pairs.next().expect("one for each")));
                let rest = whole - known;
                if i > j {
                    root[i][j] = rest / root[j][j];
                } else if rest > DEGENERATE * whole {
                    root[i][i] = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(Self(root))
    }

    /// The factors of the terms of the polynomial whose products with them are `right`.
    fn solve(&self, right: [f32; TERMS]) -> [f32; TERMS] {
        let mut right = right.map(f64::from);
        for i in 0..TERMS {
            let known: f64 = (0..i).map(|k| self.0[i][k] * right[k]).sum();
            right[i] = (right[i] - known) / self.0[i][i];
        }
        for i in (0..TERMS).rev() {
            let known: f64 = (i + 1..TERMS).map(|k| self.0[k][i] * right[k]).sum();
            right[i] = (right[i] - known) / self.0[i][i];
        }
        #[expect(clippy::cast_possible_truncation, reason = "as exact as is needed")]
        right.map(|factor| factor as f32)
    }

    /// Whether what the best of them leaves of `values` is no more than noise of this variance of a whole point.
    pub(super) fn explain(&self, weights: &Window, values: &Window, noise: f32) -> bool {
        let weighted = product(weights, values);
        let polynomial = self.solve(BASIS.each_ref().map(|term| dot(&weighted, term)));
        let mut rest = *values;
        for (factor, term) in polynomial.iter().zip(&BASIS) {
            for (rest, term) in rest.as_flattened_mut().iter_mut().zip(term.as_flattened()) {
                *rest -= factor * term;
            }
        }
        dot(weights, &product(&rest, &rest)) <= MISFIT * noise * (count(weights) - TERMS as f32)
    }

    /// What each point counts in the best of them, in the middle.
    pub(super) fn shares(&self, weights: &Window) -> Window {
        // In the middle all terms but the first one are 0.
        let factors = self.solve([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let mut shares = [[0.0; LANES]; SIDE];
        for (factor, term) in factors.iter().zip(&BASIS) {
            for (share, term) in shares.as_flattened_mut().iter_mut().zip(term.as_flattened()) {
                *share += factor * term;
            }
        }
        product(weights, &shares)
    }
}

/// Number of points that count.
pub(super) fn count(weights: &Window) -> f32 {
    let mut lanes = [0.0; LANES];
    for row in weights {
        for lane in 0..LANES {
            lanes[lane] += if row[lane] > 0.0 { 1.0 } else { 0.0 };
        }
    }
    lanes.into_iter().sum()
}
