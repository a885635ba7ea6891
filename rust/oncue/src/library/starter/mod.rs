//! The starter library: motion made by rule, so that Oncue works before any file is read.
//!
//! Each clip starts as a footstep plan (`plan`); feet follow it (`foot`), the body balances above them (`body`),
//! seats are approached and left as published kinematics have it (`seat`). `catalogue` says which clips there are.
//! Contacts and labels are known from the plan, not detected.
//!
//! # Sources
//! - D. Grieve, R. Gear, "The relationships between length of stride, step frequency, time of swing and speed of walking", Ergonomics 1966.
//! - M. P. Murray et al., "Walking patterns of normal men", J. Bone Joint Surg. 1964; "Comparison of free and fast speed walking patterns", 1966.
//! - D. A. Winter, *The Biomechanics and Motor Control of Human Gait*, 1991.
//! - T. Flash, N. Hogan, "The coordination of arm movements", J. Neurosci. 1985 (minimum jerk).
//! - S. Kajita et al., "The 3D linear inverted pendulum mode", IROS 2001.
//! - M. Schenkman et al., "Whole-body movements during rising to standing from sitting", Phys. Ther. 1990.
//! - S. Nuzik et al., "Sit-to-stand movement pattern", Phys. Ther. 1986.
//! - A. Kralj et al., "Analysis of standing up and sitting down in humans", J. Biomech. 1990.
//! - W. Janssen et al., "Determinants of the sit-to-stand movement", Phys. Ther. 2002.
//! - Swing curves: measured on the Open Motion Project by ACCAD / The Ohio State University (CC BY 3.0); see `foot`.

mod body;
mod catalogue;
mod curve;
mod foot;
mod limb;
mod plan;
mod seat;
mod style;

pub use catalogue::generate;

#[cfg(test)]
mod tests;
