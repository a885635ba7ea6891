//! Arrays in: checked and copied on the calling thread, so that no job reads memory that Python may change.

use numpy::{
    Element, PyArrayDescrMethods, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;

use crate::error::InputError;

/// The rows of an array of shape (n, 3) and of `T`'s own dtype; any strides.
pub fn rows_of_three<T: Element + Copy>(name: &str, array: &Bound<'_, PyAny>) -> PyResult<Vec<[T; 3]>> {
    let py = array.py();
    let expected = dtype::<T>(py);
    let wrong = |is: String| {
        InputError::new_err(format!("{name} must be an array of {expected} of shape (n, 3), but it is {is}."))
    };
    let untyped =
        array.cast::<PyUntypedArray>().map_err(|_| wrong(format!("of type {}", array.get_type())))?;
    if untyped.ndim() != 2 || untyped.shape()[1] != 3 || !untyped.dtype().is_equiv_to(&expected) {
        let shape: Vec<String> = untyped.shape().iter().map(usize::to_string).collect();
        return Err(wrong(format!("{} of shape ({})", untyped.dtype(), shape.join(", "))));
    }
    let typed: PyReadonlyArray2<'_, T> = array.extract()?;
    Ok(typed.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// All numbers of a float32 array of the given shape (`None`: any length), row by row; any strides.
pub fn array(name: &str, array: &Bound<'_, PyAny>, shape: &[Option<usize>]) -> PyResult<Vec<f32>> {
    let sizes: Vec<String> = shape.iter().map(|n| n.map_or("n".into(), |n| n.to_string())).collect();
    let wrong = |is: String| {
        let expected = sizes.join(", ");
        InputError::new_err(format!(
            "{name} must be an array of float32 of shape ({expected}), but it is {is}."
        ))
    };
    let untyped =
        array.cast::<PyUntypedArray>().map_err(|_| wrong(format!("of type {}", array.get_type())))?;
    let fits = untyped.ndim() == shape.len()
        && untyped.shape().iter().zip(shape).all(|(n, expected)| expected.is_none_or(|e| e == *n));
    if !fits || !untyped.dtype().is_equiv_to(&dtype::<f32>(array.py())) {
        let shape: Vec<String> = untyped.shape().iter().map(usize::to_string).collect();
        return Err(wrong(format!("{} of shape ({})", untyped.dtype(), shape.join(", "))));
    }
    let typed: PyReadonlyArrayDyn<'_, f32> = array.extract()?;
    Ok(typed.as_array().iter().copied().collect())
}
