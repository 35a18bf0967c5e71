//! A box at every moment: one lane a moment, so that loops over lanes become vector code.

/// Moments at most.
pub(super) const LANES: usize = 8;

/// One number a moment.
pub(super) type Lanes = [f32; LANES];

/// A box at every moment. Six rows: the lower corner negated, then the upper
/// one; so that a box grows by the greater of two numbers everywhere.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Boxes {
    pub(super) rows: [Lanes; 6],
}

impl Boxes {
    pub(super) const EMPTY: Self = Self {
        rows: [[f32::NEG_INFINITY; LANES]; 6],
    };

    /// Grows to hold `other` at every moment. There is no NaN in either.
    #[inline]
    pub(super) fn grow(&mut self, other: &Self) {
        for (row, other) in self.rows.iter_mut().zip(&other.rows) {
            for (a, &b) in row.iter_mut().zip(other) {
                *a = if b > *a { b } else { *a };
            }
        }
    }

    /// Twice the centre along `axis` at every moment.
    #[inline]
    pub(super) fn centers(&self, axis: usize) -> Lanes {
        std::array::from_fn(|l| self.rows[axis + 3][l] - self.rows[axis][l])
    }

    /// Likewise at one moment.
    #[inline]
    pub(super) fn center(&self, axis: usize, lane: usize) -> f32 {
        self.rows[axis + 3][lane] - self.rows[axis][lane]
    }
}

/// Measures surface areas inside one node, in units of its longest edge at any
/// moment, so that nothing underflows in small nodes.
///
/// Every edge is lengthened by 2^-20 of that, so that boxes of no area are still told apart by their length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ruler<'a> {
    weights: &'a Lanes,
    scale: f32,
}

impl<'a> Ruler<'a> {
    const PAD: f32 = 1.0 / (1 << 20) as f32;
    /// Edges below this are none. Coordinates are at most about 1.
    const LEAST: f32 = 1.0 / (1_u64 << 60) as f32;

    /// `weights` are what an area of one root's edge squared costs at each moment.
    pub(super) fn new(node: &Boxes, weights: &'a Lanes) -> Self {
        let edges = (0..3).flat_map(|axis| (0..LANES).map(move |l| (axis, l)));
        let longest = edges
            .map(|(axis, l)| node.rows[axis][l] + node.rows[axis + 3][l])
            .fold(Self::LEAST, f32::max);
        Self {
            weights,
            scale: 1.0 / longest,
        }
    }

    /// Half the surface area, averaged over the moments by their weights.
    #[inline]
    pub(super) fn half_area(&self, b: &Boxes) -> f32 {
        let edge = |axis: usize, l: usize| {
            (b.rows[axis][l] + b.rows[axis + 3][l]) * self.scale + Self::PAD
        };
        let mut areas = [0.0; LANES];
        for (l, area) in areas.iter_mut().enumerate() {
            let (x, y, z) = (edge(0, l), edge(1, l), edge(2, l));
            *area = (x * y + (x + y) * z) * self.weights[l];
        }
        // Pairwise, so that additions need not wait for each other.
        let [a, b, c, d, e, f, g, h] = areas;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }
}
