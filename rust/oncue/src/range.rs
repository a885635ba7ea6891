//! Checks of settings: the first value out of its range becomes a sentence that names it.

use std::fmt::Display;
use std::ops::RangeInclusive;

use crate::error::{Error, Result};

/// A value, or several, that must lie in a range.
pub(crate) trait Ranged<N> {
    /// # Errors
    /// [`Error::Input`] naming the first value that lies outside, or is not a number.
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<N>) -> Result<()>;
}

fn check_one<N: PartialOrd + Display + Copy>(
    value: N,
    section: &str,
    field: &str,
    range: &RangeInclusive<N>,
) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Error::input(format!(
        "The setting {section}.{field} is {value}; it must be {} to {}.",
        range.start(),
        range.end()
    )))
}

impl Ranged<f32> for f32 {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<f32>) -> Result<()> {
        check_one(*self, section, field, range)
    }
}

impl Ranged<usize> for usize {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<usize>) -> Result<()> {
        check_one(*self, section, field, range)
    }
}

impl Ranged<u32> for u32 {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<u32>) -> Result<()> {
        check_one(*self, section, field, range)
    }
}

impl<N, T: Ranged<N>> Ranged<N> for [T] {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<N>) -> Result<()> {
        self.iter().try_for_each(|value| value.check(section, field, range))
    }
}

impl<N, T: Ranged<N>, const COUNT: usize> Ranged<N> for [T; COUNT] {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<N>) -> Result<()> {
        self.as_slice().check(section, field, range)
    }
}

impl<N, T: Ranged<N>> Ranged<N> for Vec<T> {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<N>) -> Result<()> {
        self.as_slice().check(section, field, range)
    }
}

impl<N, T: Ranged<N>> Ranged<N> for Option<T> {
    fn check(&self, section: &str, field: &str, range: &RangeInclusive<N>) -> Result<()> {
        self.as_ref().map_or(Ok(()), |value| value.check(section, field, range))
    }
}

/// How many values a list has.
pub(crate) fn check_length<T>(
    list: &[T],
    section: &str,
    field: &str,
    range: RangeInclusive<usize>,
) -> Result<()> {
    if range.contains(&list.len()) {
        return Ok(());
    }
    Err(Error::input(format!(
        "The setting {section}.{field} has {} values; it must have {} to {}.",
        list.len(),
        range.start(),
        range.end()
    )))
}

/// Checks each field of a struct against its range. Every field must be named, with a range or among the `free`: one that is
/// forgotten does not compile.
macro_rules! check_ranges {
    ($value:expr, $section:expr, $type:ident { $($field:ident: $range:expr),* $(,)? }, free { $($free:ident),* $(,)? }) => {{
        let $type { $($field,)* $($free: _,)* } = $value;
        $( $crate::range::Ranged::check($field, $section, stringify!($field), &$range)?; )*
    }};
}
pub(crate) use check_ranges;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_value_that_lies_outside_is_named() {
        let sentence = |result: Result<()>| result.unwrap_err().to_string();
        assert!(0.5f32.check("a", "b", &(0.0..=1.0)).is_ok());
        assert_eq!(
            sentence(2.0f32.check("a", "b", &(0.0..=1.5))),
            "The setting a.b is 2; it must be 0 to 1.5."
        );
        assert!(sentence(f32::NAN.check("a", "b", &(0.0..=1.0))).contains("is NaN"));
        assert!(sentence([0.1f32, f32::INFINITY].check("a", "b", &(0.0..=1.0))).contains("is inf"));
        assert!(sentence(vec![1usize, 0].check("a", "b", &(1..=2))).contains("is 0"));
        assert!(None::<f32>.check("a", "b", &(0.0..=1.0)).is_ok());
        assert!(sentence(check_length(&[0; 3], "a", "b", 0..=2)).contains("3 values"));
    }
}
