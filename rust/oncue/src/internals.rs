//! What the benches, examples and tests of this repository look into. No part of the interface: it changes without notice.

pub use crate::controller::policy::{Gaussian, Normalizer, draw};
pub use crate::controller::ppo::{Ppo, Targets};
pub use crate::controller::rollout::{Rollout, Tuples};

pub use crate::library::feature::{Future, feature_size, write_feature};
pub use crate::library::retarget::recognize_unit;
pub use crate::library::sampler::{Sampler, leg_length};
pub use crate::library::search::SearchIndex;
pub use crate::library::up_axis::UpAxis;
pub use crate::manifold::autoencoder::DecoderWorkspace;
pub use crate::manifold::kinematics::{Kinematics, RootPath};
pub use crate::manifold::window::{FEATURES, WINDOW, from_motion};
pub use crate::motion::skeleton::LIMB_BOX_COUNT;
pub use crate::nn::{Activations, Adam, Conv1d, Mlp};
pub use crate::practice::{PracticeRoom, practice_room};

/// Feet.
pub mod foot {
    pub use crate::library::foot::sole;
}

/// Names of joints.
pub mod joint_names {
    pub use crate::library::joint_names::recognize;
}

/// Checkpoints of trainings.
pub mod checkpoint {
    pub use crate::manifold::checkpoint::decodes;
}

/// Files of captures.
pub mod mocap_file {
    pub use crate::library::mocap_file::read;
}

/// Faults of a library's motion.
pub mod quality {
    pub use crate::library::quality::{faults, knee_flexion, measure};
}
