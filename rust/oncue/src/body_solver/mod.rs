//! The finishing pass: one smooth, damped correction of a span of postures towards what they are to meet.
//!
//! `degrees` is what a body can do, `term` what a frame should meet, `finish` the least-squares problem over the span, solved
//! with a `banded` factorization. `feet` says what holds the feet, `touch` what carries a seated body.

mod banded;
mod degrees;
mod feet;
mod finish;
mod term;
mod touch;

pub(crate) use degrees::DegreesOfFreedom;
pub(crate) use feet::{FootPlaces, FootPlan, is_supported};
pub(crate) use finish::{FADE_FRAMES, Span, correct};
pub(crate) use term::{FoundTerms, Term, centre_of_mass};
pub(crate) use touch::Surfaces;
