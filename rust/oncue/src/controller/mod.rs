//! The action controller A: π(a_t | s_t, W, φ_A), optimized by PPO (LAMA, sections 3.2 and 3.4).
//!
//! [`state`] s_t = ψ(m_{t-1}, m_t, W, φ_A) → [`policy`] π → [`signal`] a_t → [`episode`] (S plays it in an [`environment`],
//! [`reward`] R_total judges it) → [`ppo`] improves π → [`optimize`] runs the loop and [`kept`] chooses the motion.

pub mod environment;
pub mod episode;
pub mod kept;
pub mod optimize;
pub mod policy;
pub mod policy_file;
pub mod ppo;
pub mod reward;
pub mod robustness;
pub mod rollout;
pub mod signal;
pub mod state;

pub use environment::Environment;
pub use episode::EpisodeEnd;
pub use kept::{KeptMotion, keep_motion};
pub use optimize::{OptimizedPolicy, optimize_policy};
pub use policy::Policy;
pub use policy_file::{PolicyOrigin, StoredPolicy, request_of};
pub use robustness::{Robustness, RobustnessSettings, robustness};
