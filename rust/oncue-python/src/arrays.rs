//! Arrays in: checked and copied on the calling thread, so that no job reads memory that Python may change.

use ndarray::{Array, Dimension};
use numpy::{Element, PyArrayDescrMethods, PyReadonlyArray, PyUntypedArray, PyUntypedArrayMethods, dtype};
use pyo3::prelude::*;

use crate::error::InputError;

/// A copy of an array of `T`'s own dtype and of the given shape (`None`: any length), whatever its strides.
///
/// # Errors
/// `InputError` naming the array, what it is and what it should be.
pub fn array<T: Element + Copy, D: Dimension>(
    name: &str,
    array: &Bound<'_, PyAny>,
    shape: &[Option<usize>],
) -> PyResult<Array<T, D>> {
    let expected = dtype::<T>(array.py());
    let wrong = |is: String| {
        let sizes: Vec<String> = shape.iter().map(|n| n.map_or("n".into(), |n| n.to_string())).collect();
        let sizes = sizes.join(", ");
        InputError::new_err(format!(
            "{name} must be an array of {expected} of shape ({sizes}), but it is {is}."
        ))
    };
    let untyped =
        array.cast::<PyUntypedArray>().map_err(|_| wrong(format!("of type {}", array.get_type())))?;
    let fits = untyped.ndim() == shape.len()
        && untyped.shape().iter().zip(shape).all(|(n, expected)| expected.is_none_or(|e| e == *n));
    if !fits || !untyped.dtype().is_equiv_to(&expected) {
        let shape: Vec<String> = untyped.shape().iter().map(usize::to_string).collect();
        return Err(wrong(format!("{} of shape ({})", untyped.dtype(), shape.join(", "))));
    }
    let typed: PyReadonlyArray<'_, T, D> = array.extract()?;
    Ok(typed.as_array().to_owned())
}
