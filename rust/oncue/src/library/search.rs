//! k* = argmin_k ‖w_f ⊙ (x - y_k)‖² (LAMA, eq. 2), exactly, in microseconds.
//!
//! The weighted features are turned into their principal components, which changes no distance.
//! Frames are sorted like the leaves of a k-d tree, so that neighbours in memory are alike; boxes over
//! the first components bound whole groups of them from below; groups that cannot hold the best are
//! passed over, and what is left is summed component by component until it is too far. Frames lie in
//! blocks of 16 with the frame as the fastest index, so that the compiler vectorises the loops; the
//! level is chosen at run time, and every level does the same arithmetic in the same order.

use ndarray::ArrayView2;

use crate::math::eigen::symmetric_eigen;
use crate::simd::{Kernel, Level, Simd};

/// Frames in a block.
const BLOCK_FRAMES: usize = 16;
/// Blocks in a group.
const GROUP_BLOCKS: usize = 8;
/// Groups whose bounds are found side by side.
const RANK: usize = 8;
/// Components that the boxes span.
const BOXED: usize = 16;
/// Components summed between two looks at whether to give up.
const STRIDE: usize = 8;

/// The best match of a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Index of the entry, in the order the features were given.
    pub entry: usize,
    /// ‖w_f ⊙ (x - y_k)‖².
    pub cost: f32,
}

/// The exact nearest-neighbour index over one action type's features.
#[derive(Debug, Clone, Default)]
pub struct SearchIndex {
    weights: Vec<f32>,
    /// Padded number of components: a multiple of [`STRIDE`].
    components: usize,
    /// Row r is the r-th principal direction (components × weights.len()).
    basis: Vec<f32>,
    entries: usize,
    /// Entry at each place in memory, and the place of each entry.
    entry_at: Vec<u32>,
    place_of: Vec<u32>,
    /// [block][component][lane]
    data: Vec<f32>,
    /// [group][boxed component][block in group], lower and upper bounds.
    block_lower: Vec<f32>,
    block_upper: Vec<f32>,
    /// [rank][boxed component][group in rank], of groups in ranks of [`RANK`].
    group_lower: Vec<f32>,
    group_upper: Vec<f32>,
}

impl SearchIndex {
    /// Builds the index over `features`, (entries × numbers of a feature), of which each column has its weight.
    ///
    /// # Panics
    /// When there are not as many weights as columns; shapes are fixed by the code, never by input.
    pub fn build(features: ArrayView2<f32>, weights: &[f32]) -> Self {
        let (entries, size) = features.dim();
        assert_eq!(size, weights.len());
        let components = size.next_multiple_of(STRIDE).max(BOXED);
        let weighted: Vec<f32> = features
            .rows()
            .into_iter()
            .flat_map(|y| y.into_iter().zip(weights).map(|(y, w)| y * w))
            .collect();
        let mut basis = principal_directions(&weighted, size);
        basis.resize(components * size, 0.0);

        let blocks = entries.div_ceil(BLOCK_FRAMES);
        let groups = blocks.div_ceil(GROUP_BLOCKS);
        // Lanes past the end hold a far-away value, so they never win.
        let mut rotated = vec![0.0; entries * components];
        for (y, out) in weighted.chunks_exact(size.max(1)).zip(rotated.chunks_exact_mut(components)) {
            for (c, out) in out.iter_mut().enumerate() {
                *out = dot(&basis[c * size..(c + 1) * size], y);
            }
        }
        let mut entry_at: Vec<u32> = (0..entries as u32).collect();
        sort_as_leaves(&mut entry_at, &rotated, components);
        let mut place_of = vec![0; entries];
        let mut data = vec![1e15; groups * GROUP_BLOCKS * BLOCK_FRAMES * components];
        for (place, &entry) in entry_at.iter().enumerate() {
            place_of[entry as usize] = place as u32;
            let block = &mut data[(place / BLOCK_FRAMES) * BLOCK_FRAMES * components..];
            let y = &rotated[entry as usize * components..(entry as usize + 1) * components];
            for (c, y) in y.iter().enumerate() {
                block[c * BLOCK_FRAMES + place % BLOCK_FRAMES] = *y;
            }
        }
        let mut index = Self {
            weights: weights.to_vec(),
            components,
            basis,
            entries,
            entry_at,
            place_of,
            data,
            block_lower: vec![f32::INFINITY; groups * BOXED * GROUP_BLOCKS],
            block_upper: vec![f32::NEG_INFINITY; groups * BOXED * GROUP_BLOCKS],
            group_lower: vec![f32::INFINITY; groups.next_multiple_of(RANK) * BOXED],
            group_upper: vec![f32::NEG_INFINITY; groups.next_multiple_of(RANK) * BOXED],
        };
        for place in 0..entries {
            let (block, lane) = (place / BLOCK_FRAMES, place % BLOCK_FRAMES);
            let group = block / GROUP_BLOCKS;
            for c in 0..BOXED {
                let v = index.data[(block * components + c) * BLOCK_FRAMES + lane];
                let b = (group * BOXED + c) * GROUP_BLOCKS + block % GROUP_BLOCKS;
                index.block_lower[b] = index.block_lower[b].min(v);
                index.block_upper[b] = index.block_upper[b].max(v);
                let g = (group / RANK * BOXED + c) * RANK + group % RANK;
                index.group_lower[g] = index.group_lower[g].min(v);
                index.group_upper[g] = index.group_upper[g].max(v);
            }
        }
        index
    }

    /// Entries.
    pub fn len(&self) -> usize {
        self.entries
    }

    /// Whether there is nothing to be found.
    pub fn is_empty(&self) -> bool {
        self.entries == 0
    }

    /// The exact best match of `query` (unweighted, as the features were), or `None` for an empty index.
    ///
    /// `hint` is an entry that is likely close: it only speeds the search up. Of equal costs the
    /// lowest entry wins. Entries whose place in `passed_over` says so are not found; it may be shorter than the index.
    pub fn nearest(&self, query: &[f32], hint: Option<usize>, passed_over: &[bool]) -> Option<Match> {
        if self.entries == 0 {
            return None;
        }
        let found = Level::current().run_in_eights(Nearest { index: self, query, hint, passed_over });
        // A query that holds what is no number, or one beyond all numbers, is near to nothing.
        (found.entry != usize::MAX && found.cost.is_finite()).then_some(found)
    }

    #[inline(always)]
    fn nearest_impl(&self, query: &[f32], hint: Option<usize>, passed_over: &[bool]) -> Match {
        let q = self.project(query);
        let mut best = Match { entry: usize::MAX, cost: f32::INFINITY };
        // All boxes would seem to hold it, even those that are none.
        if !q.iter().all(|number| number.is_finite()) {
            return best;
        }
        if let Some(hint) = hint.filter(|h| *h < self.entries) {
            self.scan_block(self.place_of[hint] as usize / BLOCK_FRAMES, &q, passed_over, &mut best);
        }
        let lower = self.group_lower.chunks_exact(BOXED * RANK);
        let upper = self.group_upper.chunks_exact(BOXED * RANK);
        let bounds: Vec<[f32; RANK]> =
            lower.zip(upper).map(|(lower, upper)| bounds_of(lower, upper, &q)).collect();
        // The most promising group first, then the others in order with a tight bound.
        let bounds = bounds.as_flattened();
        let mut first = 0;
        for (group, bound) in bounds.iter().enumerate() {
            if *bound < bounds[first] {
                first = group;
            }
        }
        self.scan_group(first, &q, passed_over, &mut best);
        for (group, bound) in bounds.iter().enumerate() {
            // Where all is passed over so far, what lies past the last group must not be looked at.
            if *bound <= best.cost && bound.is_finite() && group != first {
                self.scan_group(group, &q, passed_over, &mut best);
            }
        }
        best
    }

    /// ‖w_f ⊙ (x - y_k)‖² of one entry.
    pub fn cost(&self, query: &[f32], entry: usize) -> f32 {
        let q = self.project(query);
        let place = self.place_of[entry] as usize;
        let block = &self.data[(place / BLOCK_FRAMES) * BLOCK_FRAMES * self.components..];
        let mut cost = 0.0;
        for (c, q) in q[..self.components].iter().enumerate() {
            let d = block[c * BLOCK_FRAMES + place % BLOCK_FRAMES] - q;
            cost += d * d;
        }
        cost
    }

    /// The query's principal components.
    #[inline(always)]
    fn project(&self, query: &[f32]) -> [f32; 64] {
        let size = self.weights.len();
        let mut weighted = [0.0f32; 64];
        for ((o, x), w) in weighted.iter_mut().zip(query).zip(&self.weights) {
            *o = x * w;
        }
        let mut q = [0.0f32; 64];
        for (c, q) in q[..self.components].iter_mut().enumerate() {
            *q = dot(&self.basis[c * size..(c + 1) * size], &weighted[..size]);
        }
        q
    }

    #[inline(always)]
    fn scan_group(&self, group: usize, q: &[f32; 64], passed_over: &[bool], best: &mut Match) {
        let boxes = group * BOXED * GROUP_BLOCKS..(group + 1) * BOXED * GROUP_BLOCKS;
        let bounds: [f32; GROUP_BLOCKS] =
            bounds_of(&self.block_lower[boxes.clone()], &self.block_upper[boxes], q);
        for (lane, bound) in bounds.into_iter().enumerate() {
            if bound <= best.cost && bound.is_finite() {
                self.scan_block(group * GROUP_BLOCKS + lane, q, passed_over, best);
            }
        }
    }

    #[inline(always)]
    fn scan_block(&self, block: usize, q: &[f32; 64], passed_over: &[bool], best: &mut Match) {
        let data =
            &self.data[block * BLOCK_FRAMES * self.components..(block + 1) * BLOCK_FRAMES * self.components];
        let mut cost = [0.0f32; BLOCK_FRAMES];
        for (chunk, q) in data.chunks_exact(BLOCK_FRAMES * STRIDE).zip(q.chunks_exact(STRIDE)) {
            for (row, q) in chunk.chunks_exact(BLOCK_FRAMES).zip(q) {
                for lane in 0..BLOCK_FRAMES {
                    let d = row[lane] - q;
                    cost[lane] += d * d;
                }
            }
            let mut near = false;
            for cost in &cost {
                near |= *cost <= best.cost;
            }
            if !near {
                return;
            }
        }
        for (lane, &cost) in cost.iter().enumerate() {
            let Some(&entry) = self.entry_at.get(block * BLOCK_FRAMES + lane) else { break };
            let entry = entry as usize;
            let nearer = cost < best.cost || (cost == best.cost && entry < best.entry);
            if nearer && !passed_over.get(entry).is_some_and(|over| *over) {
                *best = Match { entry, cost };
            }
        }
    }
}

/// [`SearchIndex::nearest`] of an index that holds something.
struct Nearest<'a> {
    index: &'a SearchIndex,
    query: &'a [f32],
    hint: Option<usize>,
    passed_over: &'a [bool],
}

impl Kernel for Nearest<'_> {
    type Output = Match;

    /// The compiler lays the sums over blocks out in whatever vectors the level has.
    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> Match {
        self.index.nearest_impl(self.query, self.hint, self.passed_over)
    }
}

/// How near what lies in each of these boxes can be, at most a little less; infinite for an empty one.
#[inline(always)]
fn bounds_of<const BOXES: usize>(lower: &[f32], upper: &[f32], q: &[f32; 64]) -> [f32; BOXES] {
    let mut bounds = [0.0f32; BOXES];
    for ((lower, upper), q) in lower.chunks_exact(BOXES).zip(upper.chunks_exact(BOXES)).zip(q) {
        for lane in 0..BOXES {
            let d = (lower[lane] - q).max(q - upper[lane]).max(0.0);
            bounds[lane] += d * d;
        }
    }
    // Rounding must not lift the bound over the true cost.
    bounds.map(|bound| 0.9999 * bound)
}

/// Orders `entries` (rows of `rotated`, `components` long) as the leaves of a k-d tree: halved, at a whole
/// number of blocks, along the boxed component that spreads most.
fn sort_as_leaves(entries: &mut [u32], rotated: &[f32], components: usize) {
    if entries.len() <= BLOCK_FRAMES {
        entries.sort_unstable();
        return;
    }
    let value = |entry: u32, c: usize| rotated[entry as usize * components + c];
    let spread = |c: usize| {
        let (low, high) = entries.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &e| {
            (low.min(value(e, c)), high.max(value(e, c)))
        });
        high - low
    };
    let widest = (0..BOXED).map(|c| (c, spread(c))).fold((0, -1.0), |a, b| if b.1 > a.1 { b } else { a }).0;
    let unit = if entries.len() > 2 * BLOCK_FRAMES * GROUP_BLOCKS {
        BLOCK_FRAMES * GROUP_BLOCKS
    } else {
        BLOCK_FRAMES
    };
    let middle = (entries.len() / 2).next_multiple_of(unit).min((entries.len() - 1) / unit * unit).max(1);
    entries.select_nth_unstable_by(middle, |a, b| {
        value(*a, widest).total_cmp(&value(*b, widest)).then(a.cmp(b))
    });
    let (low, high) = entries.split_at_mut(middle);
    sort_as_leaves(low, rotated, components);
    sort_as_leaves(high, rotated, components);
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 8];
    let (ac, bc) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = ac.remainder().iter().zip(bc.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in ac.zip(bc) {
        for lane in 0..8 {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    lanes.iter().sum::<f32>() + rest
}

/// The eigenvectors of the covariance of `rows` (each `size` long), largest variance first, one a row.
/// Orthonormal whatever the data: the axes themselves where a number is not finite.
fn principal_directions(rows: &[f32], size: usize) -> Vec<f32> {
    let n = (rows.len() / size.max(1)).max(1) as f64;
    let mut mean = vec![0.0f64; size];
    for row in rows.chunks_exact(size.max(1)) {
        mean.iter_mut().zip(row).for_each(|(m, v)| *m += f64::from(*v) / n);
    }
    let mut a = vec![0.0f64; size * size];
    let mut centred = vec![0.0f64; size];
    for row in rows.chunks_exact(size.max(1)) {
        for i in 0..size {
            centred[i] = f64::from(row[i]) - mean[i];
        }
        for i in 0..size {
            for j in 0..=i {
                a[i * size + j] += centred[i] * centred[j] / n;
            }
        }
    }
    for i in 0..size {
        for j in 0..i {
            a[j * size + i] = a[i * size + j];
        }
    }
    match symmetric_eigen(&a, size) {
        Some((_, vectors)) => vectors.into_iter().map(|v| v as f32).collect(),
        None => (0..size * size).map(|i| f32::from(u8::from(i / size == i % size))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    /// A drifting random walk, as neighbouring frames are, in `size` dimensions.
    fn features(seed: u64, entries: usize, size: usize) -> Vec<f32> {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut here = vec![0.0f32; size];
        (0..entries)
            .flat_map(|_| {
                here.iter_mut().for_each(|v| *v = *v * 0.98 + rng.random_range(-0.2..0.2));
                here.clone()
            })
            .collect()
    }

    fn brute_force(features: &[f32], weights: &[f32], query: &[f32], passed_over: &[bool]) -> (usize, f64) {
        let mut best = (0, f64::INFINITY);
        for (k, y) in features.chunks_exact(weights.len()).enumerate() {
            let cost: f64 = y
                .iter()
                .zip(query)
                .zip(weights)
                .map(|((y, x), w)| (f64::from(*w) * f64::from(x - y)).powi(2))
                .sum();
            if cost < best.1 && !passed_over.get(k).is_some_and(|over| *over) {
                best = (k, cost);
            }
        }
        best
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn agrees_with_brute_force(seed in 0u64..1000, entries in 1usize..900, size in 3usize..48, noise in 0.0f32..2.0) {
            let y = features(seed, entries, size);
            let weights: Vec<f32> = (0..size).map(|i| 0.2 + 0.1 * i as f32).collect();
            let index = SearchIndex::build(ArrayView2::from_shape((entries, size), &y).expect("a matrix"), &weights);
            let mut rng = Pcg32::seed_from_u64(seed + 7);
            for _ in 0..8 {
                let k = rng.random_range(0..entries);
                let query: Vec<f32> = y[k * size..(k + 1) * size].iter().map(|v| v + noise * rng.random_range(-1.0..1.0)).collect();
                // Nothing is passed over, or all but every third.
                let passed_over: Vec<bool> = if seed % 3 == 0 { Vec::new() } else { (0..entries).map(|k| k % 3 != 0).collect() };
                let (entry, cost) = brute_force(&y, &weights, &query, &passed_over);
                let hint = (seed % 2 == 0).then_some(k);
                let found = index.nearest(&query, hint, &passed_over).expect("not empty");
                let portable = Level::Portable.run_in_eights(Nearest { index: &index, query: &query, hint, passed_over: &passed_over });
                prop_assert!(!passed_over.get(found.entry).is_some_and(|over| *over));
                prop_assert_eq!(found, portable);
                // Two frames may tie to the last bit of f32; then either is exact.
                let tolerance = 1e-3 * (1.0 + cost);
                prop_assert!((f64::from(found.cost) - cost).abs() < tolerance, "{found:?} {entry} {cost}");
                prop_assert!((f64::from(index.cost(&query, found.entry)) - cost).abs() < tolerance);
            }
        }
    }

    #[test]
    fn who_passes_over_all_finds_nothing() {
        let y = features(3, 40, 4);
        let index = SearchIndex::build(ArrayView2::from_shape((40, 4), &y).expect("a matrix"), &[1.0; 4]);
        assert_eq!(index.nearest(&y[..4], Some(0), &[true; 40]), None);
        assert_eq!(index.nearest(&y[..4], None, &[true; 39]).map(|m| m.entry), Some(39));
    }

    #[test]
    fn what_is_no_number_is_near_to_nothing() {
        let (y, weights) = (features(3, 400, 5), [0.5, 1.0, 1.0, 2.0, 0.1]);
        let index = SearchIndex::build(ArrayView2::from_shape((400, 5), &y).expect("a matrix"), &weights);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            for place in 0..5 {
                let mut query = y[35..40].to_vec();
                query[place] = bad;
                for hint in [None, Some(7), Some(usize::MAX)] {
                    assert_eq!(index.nearest(&query, hint, &[]), None, "{bad} at {place} from {hint:?}");
                }
            }
        }
        // What was found before such a query is found after it.
        assert_eq!(index.nearest(&y[35..40], Some(399), &[]).map(|found| found.entry), Some(7));
        // An entry that holds none is never found, and those beside it are.
        let mut broken = y.clone();
        broken[37] = f32::NAN;
        let index =
            SearchIndex::build(ArrayView2::from_shape((400, 5), &broken).expect("a matrix"), &weights);
        for k in (0..400).filter(|&k| k != 7) {
            assert_eq!(index.nearest(&y[5 * k..5 * k + 5], None, &[]).map(|found| found.entry), Some(k));
        }
    }

    #[test]
    fn an_empty_index_finds_nothing() {
        assert_eq!(
            SearchIndex::build(ArrayView2::from(&[[0.0; 2]; 0]), &[1.0, 2.0]).nearest(&[0.0, 0.0], None, &[]),
            None
        );
    }
}
