//! The body as flesh and bone: its girth, how far its joints go, and limbs that run into it.
//!
//! What a motion is measured by here, it is also kept to: synthesizer, finishing pass and figures read the same numbers.

/// A limb that is deeper than this in something can be seen to be, metres: less is within what bones of fixed lengths blur.
pub(crate) const DEEP: f32 = 0.01;

mod body_part;
mod joint_limits;
mod own_body;

pub(crate) use body_part::{BodyCapsules, SHAPES, half_way};
pub use body_part::{BodyPart, body_capsules};
pub use joint_limits::LimitedTurn;
pub(crate) use joint_limits::{
    EASY_ELBOW, beyond_limits, elbow_beyond, elbow_flexion, shoulder_beyond, wrist_beyond,
};
pub(crate) use own_body::{OwnContact, arm_contacts, arm_depth, leg_contacts, own_depth, touching};
