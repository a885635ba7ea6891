//! The unified skeleton, the posture m_t, the motion M = {m_t}.

pub mod posture;
pub mod skeleton;
pub mod smoothness;
pub mod speed;

pub use posture::{Pose, Posture};
pub use skeleton::{BODY_BOXES, BoxNode, JOINT_COUNT, Joint, Limb};

use serde::{Deserialize, Serialize};

/// Every motion in the core runs at 30 Hz (LAMA, section 3.3); Blender's scene rate is met when keys are written.
pub const FRAME_RATE: f32 = 30.0;

/// Foot contact c of the left and the right foot: 0 in the air, 0.5 near the floor, 1 planted (LAMA, section 3.3).
pub type FootContact = [f32; 2];

/// M = {m_t}: postures at [`FRAME_RATE`], with the foot contact of each frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// m_t, one a frame.
    pub postures: Vec<Posture>,
    /// As long as `postures`.
    pub contacts: Vec<FootContact>,
}

impl Motion {
    /// Frames.
    pub fn len(&self) -> usize {
        self.postures.len()
    }

    /// Whether it has no frames.
    pub fn is_empty(&self) -> bool {
        self.postures.is_empty()
    }
}
