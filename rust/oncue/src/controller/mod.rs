//! The action controller A: π(a_t | s_t, W, φ_A), optimized by PPO (LAMA, sections 3.2 and 3.4).
//!
//! `state` s_t = ψ(m_{t-1}, m_t, W, φ_A) → `policy` π → `signal` a_t → `episode` (S plays it in an `environment`,
//! `reward` R_total judges it) → `ppo` improves π → `optimize` runs the loop and `kept` chooses the motion
//! to a take's `taste`.

pub(crate) mod environment;
pub(crate) mod episode;
pub(crate) mod kept;
pub(crate) mod optimize;
pub(crate) mod policy;
pub(crate) mod policy_file;
pub(crate) mod ppo;
pub(crate) mod reward;
pub(crate) mod robustness;
pub(crate) mod rollout;
pub(crate) mod signal;
pub(crate) mod state;
pub(crate) mod taste;

pub use environment::Environment;
pub use episode::{EpisodeEnd, Tally};
pub use kept::{KeptMotion, keep_motion};
pub use optimize::{OptimizedPolicy, UpdateFigures, optimize_policy};
pub use policy::Policy;
pub use policy_file::{PolicyOrigin, StoredPolicy, request_of};
pub use robustness::{Robustness, RobustnessSettings, StartFigures, robustness};
