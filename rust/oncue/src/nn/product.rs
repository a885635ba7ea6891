//! C = A·B for the sizes of small networks, at every [`Level`], with bias and ReLU in the same pass.
//!
//! A tile of C, as many rows and two vectors wide, stays in registers while A and B go by. Neither is copied: A may lie
//! as it likes, for its numbers are taken one by one; the rows of B must lie one after the other, each unbroken, and be
//! readable to the end of the last tile. Layers are arranged so that they are ([`super::samples`]).

use super::matmul::View;
#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2, Avx512};
use super::vector::{Portable, Vector};
use crate::simd::Level;

/// Columns of the widest tile: rows of B and C are padded to a multiple of it.
pub const TILE: usize = 32;
/// Rows of the highest tile.
const HIGHEST: usize = 12;
/// Lanes of the widest vector.
const WIDEST: usize = TILE / 2;
/// So much of the inner dimension at a time that two vectors of each row of B stay in the first cache.
const DEPTH: usize = 384;

/// What C begins with.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    Zero,
    /// What it holds.
    Kept,
    /// In each row its number of these.
    Bias(&'a [f32]),
}

/// What becomes of the sums before they are stored.
#[derive(Debug, Clone, Copy)]
pub enum Finish<'a> {
    Plain,
    /// Their positive part.
    Relu,
    /// 0 wherever this, which lies as C does, is not positive: the derivative of ReLU.
    Passed(&'a [f32]),
}

/// Rows one after the other, `stride` apart, each padded so that whole tiles may be read (and, where it is C, written).
#[derive(Debug, Clone, Copy)]
pub struct Padded<T> {
    pub data: T,
    pub stride: usize,
}

/// C (`a.rows × columns`) = A·B at a level that the processor has.
///
/// Columns of C between `columns` and the next multiple of [`TILE`] are padding and take any values.
///
/// # Panics
/// When shapes do not fit; they are fixed by the code, never by input.
pub fn multiply(
    level: Level,
    c: Padded<&mut [f32]>,
    a: View,
    b: Padded<&[f32]>,
    columns: usize,
    start: Start,
    finish: Finish,
) {
    let width = columns.next_multiple_of(TILE);
    let holds = |rows: usize, stride: usize, length: usize| {
        rows == 0 || (stride >= width && (rows - 1) * stride + width <= length)
    };
    assert!(a.fits() && holds(a.cols, b.stride, b.data.len()) && holds(a.rows, c.stride, c.data.len()));
    let bias = match start {
        Start::Bias(bias) => {
            assert!(bias.len() >= a.rows);
            Some(bias)
        }
        _ => None,
    };
    if let Finish::Passed(by) = finish {
        assert!(holds(a.rows, c.stride, by.len()));
    }
    assert!(Level::available().any(|has| has == level));
    let depth = a.cols.max(1).div_ceil(DEPTH);
    for part in 0..depth {
        let (from, to) = (part * a.cols / depth, (part + 1) * a.cols / depth);
        let call = Call {
            rows: a.rows,
            columns,
            depth: to - from,
            a: a.data[(from * a.col_stride).min(a.data.len())..].as_ptr(),
            a_row: a.row_stride,
            a_column: a.col_stride,
            b: b.data[(from * b.stride).min(b.data.len())..].as_ptr(),
            b_row: b.stride,
            c: c.data.as_mut_ptr(),
            c_row: c.stride,
            kept: part > 0 || matches!(start, Start::Kept),
            bias: bias.filter(|_| part == 0),
            finish: if part + 1 == depth { finish } else { Finish::Plain },
        };
        // SAFETY: A, B, C and what `finish` holds were checked to reach as far as the tiles do, and the processor
        // to have the level.
        unsafe { call.run(level) };
    }
}

/// One product, checked.
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

/// The tiles of C at one level: its vector and how many rows of them fit the registers.
macro_rules! tiles {
    ($name:ident, $vector:ty, [$($rows:literal)*] $(, $feature:literal)?) => {
        $(#[target_feature(enable = $feature)])?
        unsafe fn $name(&self) {
            let highest = [$($rows),*].len();
            let count = self.rows.div_ceil(highest);
            for column in (0..self.columns).step_by(2 * <$vector>::LANES) {
                let mut row = 0;
                for tile in 0..count {
                    // As even as can be.
                    let end = (tile + 1) * self.rows / count;
                    match end - row {
                        // SAFETY: see `multiply`.
                        $($rows => unsafe { self.tile::<$vector, $rows>(row, column) },)*
                        _ => {}
                    }
                    row = end;
                }
            }
        }
    };
}

impl Call<'_> {
    unsafe fn run(&self, level: Level) {
        // SAFETY: the processor has the level.
        match level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => unsafe { self.avx512() },
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => unsafe { self.avx2() },
            _ => unsafe { self.portable() },
        }
    }

    tiles!(portable, Portable, [1 2 3 4]);
    #[cfg(target_arch = "x86_64")]
    tiles!(avx2, Avx2, [1 2 3 4 5 6], "avx2,fma");
    #[cfg(target_arch = "x86_64")]
    tiles!(avx512, Avx512, [1 2 3 4 5 6 7 8 9 10 11 12], "avx512f");

    /// `ROWS` × two vectors of C.
    #[inline(always)]
    unsafe fn tile<V: Vector, const ROWS: usize>(&self, row: usize, column: usize) {
        // SAFETY: see `multiply`.
        unsafe {
            let c = self.c.add(row * self.c_row + column);
            let mut sums = [[V::splat(0.0); 2]; ROWS];
            for r in 0..ROWS {
                let at = c.add(r * self.c_row);
                if let Some(bias) = self.bias {
                    sums[r] = [V::splat(*bias.get_unchecked(row + r)); 2];
                }
                if self.kept {
                    sums[r][0] = sums[r][0].add(V::load(at));
                    sums[r][1] = sums[r][1].add(V::load(at.add(V::LANES)));
                }
            }
            // Three rows a pointer: an x86 address has room for 0, 1 and 2 strides beside it.
            let mut a = [self.a.add(row * self.a_row); HIGHEST / 3];
            for i in 0..HIGHEST / 3 {
                a[i] = a[i].add(3 * i.min((ROWS - 1) / 3) * self.a_row);
            }
            let mut b = self.b.add(column);
            for _ in 0..self.depth {
                let (b0, b1) = (V::load(b), V::load(b.add(V::LANES)));
                for r in 0..ROWS {
                    let a = V::splat(*a[r / 3].add(r % 3 * self.a_row));
                    sums[r][0] = sums[r][0].add_product(a, b0);
                    sums[r][1] = sums[r][1].add_product(a, b1);
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
                        sums[r] = [sums[r][0].relu(), sums[r][1].relu()];
                    }
                }
                Finish::Passed(by) => {
                    let by = by.as_ptr().add(row * self.c_row + column);
                    for r in 0..ROWS {
                        let by = by.add(r * self.c_row);
                        sums[r][0] = sums[r][0].where_positive(V::load(by));
                        sums[r][1] = sums[r][1].where_positive(V::load(by.add(V::LANES)));
                    }
                }
            }
            for r in 0..ROWS {
                let at = c.add(r * self.c_row);
                sums[r][0].store(at);
                sums[r][1].store(at.add(V::LANES));
            }
        }
    }
}

/// `out[i] += rows[i] · x`, `rows` dense, at a level that the processor has.
pub fn add_row_products(level: Level, rows: &[f32], x: &[f32], out: &mut [f32]) {
    assert!(rows.len() == x.len() * out.len() && Level::available().any(|has| has == level));
    // SAFETY: the processor has the level.
    match level {
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => unsafe { row_products_avx512(rows, x, out) },
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => unsafe { row_products_avx2(rows, x, out) },
        _ => row_products::<Portable>(rows, x, out),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
unsafe fn row_products_avx512(rows: &[f32], x: &[f32], out: &mut [f32]) {
    row_products::<Avx512>(rows, x, out);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn row_products_avx2(rows: &[f32], x: &[f32], out: &mut [f32]) {
    row_products::<Avx2>(rows, x, out);
}

#[inline(always)]
fn row_products<V: Vector>(rows: &[f32], x: &[f32], out: &mut [f32]) {
    let whole = x.len() / V::LANES * V::LANES;
    for (row, out) in rows.chunks_exact(x.len().max(1)).zip(out) {
        // Several sums, so that one product need not wait for the one before.
        let mut sums = [V::splat(0.0); 4];
        for k in (0..whole).step_by(V::LANES) {
            let sum = k / V::LANES % 4;
            // SAFETY: both hold LANES numbers from k on.
            let (a, b) = unsafe { (V::load(row.as_ptr().add(k)), V::load(x.as_ptr().add(k))) };
            sums[sum] = sums[sum].add_product(a, b);
        }
        let mut lanes = [0.0; WIDEST];
        // SAFETY: no vector has more lanes than WIDEST.
        unsafe { sums[0].add(sums[1]).add(sums[2].add(sums[3])).store(lanes.as_mut_ptr()) };
        let mut sum = 0.0;
        for lane in &lanes[..V::LANES] {
            sum += lane;
        }
        for k in whole..x.len() {
            sum += row[k] * x[k];
        }
        *out += sum;
    }
}
