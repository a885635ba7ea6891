//! The constants of PPO (LAMA, section 3.4 and supplementary), and of the choice among the policy's motions.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::range::{check_length, check_ranges};

/// PPO (LAMA, supplementary, table "Details on the hyper-parameters").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PpoSettings {
    /// Hidden widths of the policy (the paper: 4 × 256) and the value network (2 × 256).
    pub policy_layers: Vec<usize>,
    /// Hidden widths of the value network.
    pub value_layers: Vec<usize>,
    /// Adam's rate for π.
    pub policy_rate: f32,
    /// Adam's rate for V.
    pub value_rate: f32,
    /// γ, λ, ε.
    pub discount: f32,
    /// λ of the advantages.
    pub lambda: f32,
    /// ε of the clipped objective.
    pub clip: f32,
    /// Tuples per update (30,000) and per gradient step (512).
    pub tuples: usize,
    /// Tuples of one gradient step.
    pub batch: usize,
    /// Passes over the tuples of an update (the paper gives none; released: 5).
    pub epochs: usize,
    /// Gradients longer than this are shortened to it.
    pub gradient_norm: f32,
    /// Initial log standard deviation of a^future and a^offset.
    pub log_std_future: f32,
    /// The same of a^offset.
    pub log_std_offset: f32,
    /// Weight of π's entropy, that of the type and that of the vector, in the objective (the paper: none).
    pub entropy: f32,
    /// At most this many updates.
    pub updates: usize,
    /// Stop when this share of the episodes from the task's own start succeed (1.1: never).
    pub solved: f32,
    /// Share of episodes that begin elsewhere on the clear floor, facing anywhere.
    pub vary_start: f32,
    /// Begin with the policy that ships with Oncue where there is none for the scene, not from scratch.
    pub prior: bool,
}

impl PpoSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "ppo",
            PpoSettings {
                policy_layers: 1..=2048,
                value_layers: 1..=2048,
                policy_rate: 0.0..=1.0,
                value_rate: 0.0..=1.0,
                discount: 0.0..=1.0,
                lambda: 0.0..=1.0,
                clip: 1e-3..=10.0,
                tuples: 1..=500_000,
                batch: 1..=100_000,
                epochs: 1..=1000,
                gradient_norm: 1e-6..=1e6,
                log_std_future: -10.0..=2.0,
                log_std_offset: -10.0..=2.0,
                entropy: 0.0..=10.0,
                updates: 0..=100_000,
                solved: 0.0..=2.0,
                vary_start: 0.0..=1.0,
            },
            free { prior }
        );
        check_length(&self.policy_layers, "ppo", "policy_layers", 0..=8)?;
        check_length(&self.value_layers, "ppo", "value_layers", 0..=8)
    }
}

impl Default for PpoSettings {
    fn default() -> Self {
        Self {
            policy_layers: vec![128; 3],
            value_layers: vec![128; 2],
            policy_rate: 2e-4,
            value_rate: 1e-3,
            discount: 0.95,
            lambda: 0.95,
            clip: 0.2,
            tuples: 8192,
            batch: 512,
            epochs: 3,
            gradient_norm: 0.5,
            log_std_future: -1.8,
            log_std_offset: -1.2,
            entropy: 0.0,
            updates: 16,
            solved: 0.9,
            vary_start: 0.5,
            prior: true,
        }
    }
}

/// Which motion is kept once the policy is optimized.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KeptSettings {
    /// Rollouts of the policy from the task's start; the best by the report's figures is kept. 1: the policy's mean alone.
    pub rollouts: usize,
    /// Rounds in which new rollouts branch off the best so far…
    pub rounds: usize,
    /// …of which so many are kept to branch off…
    pub branches: usize,
    /// …and so many rounds more while the best motion still has something that an artist would mind.
    pub more_rounds: usize,
    /// Where the way is narrow, rollouts vary a^offset by at least this standard deviation, radians (0: as the policy has
    /// it).
    pub narrow_offset: f32,
    /// Among so many consecutive seeds the library's sits and stops are shared out, so that these seeds differ as takes do
    /// (1: each enters whatever fits best).
    pub takes: usize,
    /// From -1 (calm) over 0 (as it comes) to 1 (lively): the pace, and how much moves in the clips that are entered.
    pub liveliness: f32,
    /// What makes one motion better than another.
    pub weights: CostWeights,
}

impl KeptSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "kept",
            KeptSettings {
                rollouts: 1..=100_000,
                rounds: 0..=1000,
                branches: 1..=10_000,
                more_rounds: 0..=1000,
                narrow_offset: 0.0..=10.0,
                takes: 1..=1000,
                liveliness: -1.0..=1.0,
            },
            free { weights }
        );
        self.weights.validate()
    }
}

impl Default for KeptSettings {
    fn default() -> Self {
        Self {
            rollouts: 128,
            rounds: 3,
            branches: 6,
            more_rounds: 9,
            narrow_offset: 0.2,
            takes: 5,
            liveliness: 0.0,
            weights: CostWeights::default(),
        }
    }
}

/// What an artist would mind in a motion, and how much: the motion of least cost is kept. Ours; the paper keeps whatever the
/// policy plays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CostWeights {
    /// An action that is never complete, and for each metre of the way that is left then.
    pub incomplete: f32,
    /// Each metre of the way that is left then.
    pub way_left: f32,
    /// A cue that is missed.
    pub missed: f32,
    /// The pelvis away from its place, per metre, and from its facing, per radian.
    pub residual: f32,
    /// The facing away from the cue's, per radian.
    pub facing: f32,
    /// A frame that counts as penetrating, one in which anything touches, and a single crossing.
    pub penetrating: f32,
    /// A frame in which anything touches.
    pub touching: f32,
    /// A single crossing of an edge.
    pub crossing: f32,
    /// The worst transition, and each, per C_tr + C_vel.
    pub worst_transition: f32,
    /// Each transition, per C_tr + C_vel.
    pub transition: f32,
    /// The most that a leg hurries in a frame, and each, as a share of its speed.
    pub worst_hurry: f32,
    /// Each frame in which a leg hurries, as a share of its speed.
    pub hurry: f32,
    /// The hardest jolt of a joint, and each, over the library's hardest.
    pub worst_jolt: f32,
    /// Each jolt of a joint, over the library's hardest.
    pub jolt: f32,
    /// Feet that creep, per metre of contact error.
    pub contact: f32,
    /// A metre of detour.
    pub detour: f32,
    /// A second.
    pub second: f32,
    /// A change of the pace, per m/s: people walk steadily.
    pub surge: f32,
    /// Posture offset, per squared radian and second.
    pub offset: f32,
    /// A frame in which a limb is in the own body.
    pub in_own_body: f32,
    /// How deep it is there, per metre and frame.
    pub own_depth: f32,
    /// How deep the held posture is in the scene, per metre beyond the first centimetre.
    pub held_depth: f32,
    /// Each thing that the report would say of the body in the motion as it is played, among the best.
    pub problem: f32,
    /// Each step away from the take's own taste.
    pub taste: f32,
    /// A first step without a shift of the weight, where the library has one with it.
    pub unprepared: f32,
    /// A foot that leaves the floor again soon after it has come down, the other having stayed: nobody walks so.
    pub repeated_step: f32,
    /// A foot that stands turned out or in under the leg farther than is easy, per radian and frame.
    pub twisted: f32,
}

impl CostWeights {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        const ANY: std::ops::RangeInclusive<f32> = 0.0..=1e6;
        check_ranges!(
            self,
            "kept.weights",
            CostWeights {
                incomplete: ANY,
                way_left: ANY,
                missed: ANY,
                residual: ANY,
                facing: ANY,
                penetrating: ANY,
                touching: ANY,
                crossing: ANY,
                worst_transition: ANY,
                transition: ANY,
                worst_hurry: ANY,
                hurry: ANY,
                worst_jolt: ANY,
                jolt: ANY,
                contact: ANY,
                detour: ANY,
                second: ANY,
                surge: ANY,
                offset: ANY,
                in_own_body: ANY,
                own_depth: ANY,
                held_depth: ANY,
                problem: ANY,
                taste: ANY,
                unprepared: ANY,
                repeated_step: ANY,
                twisted: ANY,
            },
            free {}
        );
        Ok(())
    }
}

impl Default for CostWeights {
    fn default() -> Self {
        Self {
            incomplete: 1e4,
            way_left: 100.0,
            missed: 1e3,
            residual: 30.0,
            facing: 4.0,
            penetrating: 0.5,
            touching: 0.2,
            crossing: 0.01,
            worst_transition: 1.5,
            transition: 0.15,
            worst_hurry: 2.0,
            hurry: 0.3,
            worst_jolt: 1.0,
            jolt: 0.05,
            contact: 60.0,
            detour: 0.8,
            second: 0.25,
            surge: 3.0,
            offset: 0.05,
            in_own_body: 0.05,
            own_depth: 2.0,
            held_depth: 200.0,
            problem: 3.0,
            taste: 0.5,
            unprepared: 2.0,
            repeated_step: 3.0,
            twisted: 0.5,
        }
    }
}
