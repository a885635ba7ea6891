//! C = A·B for the sizes of small networks, at every [`Level`], with bias and ReLU in the same pass.
//!
//! A tile of C, as many rows and two vectors wide, stays in registers while A and B go by. Neither is copied. A may
//! have any strides, because its numbers are read one by one. The rows of B must be contiguous and readable to the end of
//! the last tile. Layers are arranged so that they are ([`super::samples`]).

use ndarray::ArrayView2;

use crate::simd::{Kernel, Level, Simd};

/// Columns of the widest tile: rows of B and C are padded to a multiple of it.
pub(super) const TILE: usize = 32;
/// Rows of the highest tile.
const HIGHEST: usize = 12;
/// Lanes of the widest vector.
const WIDEST: usize = TILE / 2;
/// So much of the inner dimension at a time that two vectors of each row of B stay in the first cache.
const DEPTH: usize = 384;

/// What C begins with.
#[derive(Debug, Clone, Copy)]
pub(super) enum Start<'a> {
    Zero,
    /// What it holds.
    Kept,
    /// In each row its number of these.
    Bias(&'a [f32]),
}

/// What becomes of the sums before they are stored.
#[derive(Debug, Clone, Copy)]
pub(super) enum Finish<'a> {
    Plain,
    /// Their positive part.
    Relu,
    /// 0 wherever this, which lies as C does, is not positive: the derivative of ReLU.
    Passed(&'a [f32]),
}

/// Rows one after the other, `stride` apart, each padded so that whole tiles may be read (and, where it is C, written).
#[derive(Debug, Clone, Copy)]
pub(super) struct Padded<T> {
    pub data: T,
    pub stride: usize,
}

impl<'a> Padded<&'a [f32]> {
    /// A view's rows, where they lie one after the other, each unbroken.
    pub(super) fn of(view: &ArrayView2<'a, f32>) -> Option<Self> {
        let stride = usize::try_from(view.strides()[0]).ok().filter(|_| view.strides()[1] == 1)?;
        let length = view.nrows().checked_sub(1).map_or(0, |last| last * stride + view.ncols());
        // SAFETY: a view's elements may be read for as long as it lives, and the memory between them belongs to the same slice: views
        // of this crate are made of slices alone.
        Some(Self { data: unsafe { std::slice::from_raw_parts(view.as_ptr(), length) }, stride })
    }
}

/// C (rows of A × `columns`) = A·B at a level that the processor has.
///
/// Columns of C between `columns` and the next multiple of [`TILE`] are padding and take any values.
///
/// # Panics
/// When shapes do not fit; they are fixed by the code, never by input.
pub(super) fn multiply(
    level: Level,
    c: Padded<&mut [f32]>,
    a: ArrayView2<f32>,
    b: Padded<&[f32]>,
    columns: usize,
    start: Start,
    finish: Finish,
) {
    let width = columns.next_multiple_of(TILE);
    let holds = |rows: usize, stride: usize, length: usize| {
        rows == 0 || (stride >= width && (rows - 1) * stride + width <= length)
    };
    let (rows, inner) = a.dim();
    assert!(holds(inner, b.stride, b.data.len()) && holds(rows, c.stride, c.data.len()));
    let (Ok(a_row), Ok(a_column)) = (usize::try_from(a.strides()[0]), usize::try_from(a.strides()[1])) else {
        panic!("a matrix that runs backwards")
    };
    let bias = match start {
        Start::Bias(bias) => {
            assert!(bias.len() >= rows);
            Some(bias)
        }
        _ => None,
    };
    if let Finish::Passed(by) = finish {
        assert!(holds(rows, c.stride, by.len()));
    }
    let depth = inner.max(1).div_ceil(DEPTH);
    for part in 0..depth {
        let (from, to) = (part * inner / depth, (part + 1) * inner / depth);
        let call = Call {
            rows,
            columns,
            depth: to - from,
            // Never read beyond the view: the part begins within it, or has no columns.
            a: a.as_ptr().wrapping_add(from * a_column),
            a_row,
            a_column,
            b: b.data[(from * b.stride).min(b.data.len())..].as_ptr(),
            b_row: b.stride,
            c: c.data.as_mut_ptr(),
            c_row: c.stride,
            kept: part > 0 || matches!(start, Start::Kept),
            bias: bias.filter(|_| part == 0),
            finish: if part + 1 == depth { finish } else { Finish::Plain },
        };
        level.run(call);
    }
}

/// One product. A, B, C and what `finish` holds were checked to reach as far as the tiles do.
struct Call<'a> {
    rows: usize,
    columns: usize,
    depth: usize,
    a: *const f32,
    a_row: usize,
    a_column: usize,
    b: *const f32,
    b_row: usize,
    c: *mut f32,
    c_row: usize,
    kept: bool,
    bias: Option<&'a [f32]>,
    finish: Finish<'a>,
}

impl Kernel for Call<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let count = self.rows.div_ceil(S::TILE_ROWS);
        for column in (0..self.columns).step_by(2 * S::LANES) {
            let mut row = 0;
            for tile in 0..count {
                // As even as can be.
                let end = (tile + 1) * self.rows / count;
                macro_rules! tile_of {
                    ($($rows:literal)*) => {
                        match end - row {
                            // SAFETY: the call was checked. Higher tiles than fit the registers are not even compiled.
                            $($rows if $rows <= S::TILE_ROWS => unsafe { self.tile::<S, $rows>(simd, row, column) },)*
                            _ => {}
                        }
                    };
                }
                tile_of!(1 2 3 4 5 6 7 8 9 10 11 12);
                row = end;
            }
        }
    }
}

impl Call<'_> {
    /// `ROWS` × two vectors of C.
    ///
    /// # Safety
    /// What the call points at must reach as far as the tile does.
    #[inline(always)]
    unsafe fn tile<S: Simd, const ROWS: usize>(&self, s: S, row: usize, column: usize) {
        // SAFETY: see `multiply`.
        unsafe {
            let c = self.c.add(row * self.c_row + column);
            let mut sums = [[s.splat(0.0); 2]; ROWS];
            for r in 0..ROWS {
                let at = c.add(r * self.c_row);
                if let Some(bias) = self.bias {
                    sums[r] = [s.splat(*bias.get_unchecked(row + r)); 2];
                }
                if self.kept {
                    sums[r][0] = s.add(sums[r][0], s.load_from(at));
                    sums[r][1] = s.add(sums[r][1], s.load_from(at.add(S::LANES)));
                }
            }
            // Three rows a pointer: an x86 address has room for 0, 1 and 2 strides beside it.
            let mut a = [self.a.add(row * self.a_row); HIGHEST / 3];
            for i in 0..HIGHEST / 3 {
                a[i] = a[i].add(3 * i.min((ROWS - 1) / 3) * self.a_row);
            }
            let mut b = self.b.add(column);
            for _ in 0..self.depth {
                let (b0, b1) = (s.load_from(b), s.load_from(b.add(S::LANES)));
                for r in 0..ROWS {
                    let a = s.splat(*a[r / 3].add(r % 3 * self.a_row));
                    sums[r][0] = s.add_product(sums[r][0], a, b0);
                    sums[r][1] = s.add_product(sums[r][1], a, b1);
                }
                for i in 0..HIGHEST / 3 {
                    a[i] = a[i].wrapping_add(self.a_column);
                }
                b = b.wrapping_add(self.b_row);
            }
            match self.finish {
                Finish::Plain => {}
                Finish::Relu => {
                    for r in 0..ROWS {
                        sums[r] = sums[r].map(|sum| s.where_positive(sum, sum));
                    }
                }
                Finish::Passed(by) => {
                    let by = by.as_ptr().add(row * self.c_row + column);
                    for r in 0..ROWS {
                        let by = by.add(r * self.c_row);
                        sums[r][0] = s.where_positive(sums[r][0], s.load_from(by));
                        sums[r][1] = s.where_positive(sums[r][1], s.load_from(by.add(S::LANES)));
                    }
                }
            }
            for r in 0..ROWS {
                let at = c.add(r * self.c_row);
                s.store_to(sums[r][0], at);
                s.store_to(sums[r][1], at.add(S::LANES));
            }
        }
    }
}

/// `out[i] += rows[i] · x`, `rows` dense, at a level that the processor has.
///
/// # Panics
/// When the shapes do not fit; they are fixed by the code, never by input.
pub(super) fn add_row_products(level: Level, rows: &[f32], x: &[f32], out: &mut [f32]) {
    assert!(rows.len() == x.len() * out.len());
    level.run(RowProducts { rows, x, out });
}

struct RowProducts<'a> {
    rows: &'a [f32],
    x: &'a [f32],
    out: &'a mut [f32],
}

impl Kernel for RowProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Self { rows, x, out } = self;
        let whole = x.len() / S::LANES * S::LANES;
        for (row, out) in rows.chunks_exact(x.len().max(1)).zip(out) {
            // Several sums, so that one product need not wait for the one before.
            let mut sums = [s.splat(0.0); 4];
            for k in (0..whole).step_by(S::LANES) {
                let sum = k / S::LANES % 4;
                // SAFETY: both hold LANES numbers from k on.
                let (a, b) = unsafe { (s.load_from(row.as_ptr().add(k)), s.load_from(x.as_ptr().add(k))) };
                sums[sum] = s.add_product(sums[sum], a, b);
            }
            let mut lanes = [0.0; WIDEST];
            s.store(s.add(s.add(sums[0], sums[1]), s.add(sums[2], sums[3])), &mut lanes);
            let mut sum = 0.0;
            for lane in &lanes[..S::LANES] {
                sum += lane;
            }
            for k in whole..x.len() {
                sum += row[k] * x[k];
            }
            *out += sum;
        }
    }
}
