//! Every constant of the paper as a field, with its source; two presets.
//!
//! `Settings::preset("paper")` is the paper's table and terms (the released value where the paper gives
//! none); `Settings::default()` is what Oncue runs: the same algorithm, started from the shortest clear
//! path, with a view of a few metres, stopped when the task is solved.
//! `docs/decisions/` says why each default departs from the paper.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::library::feature::FeatureWeights;
use crate::range::{check_length, check_ranges};

/// All settings. Unknown fields are refused by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[derive(Default)]
pub struct Settings {
    /// S.
    pub synthesizer: SynthesizerSettings,
    /// s_t.
    pub state: StateSettings,
    /// a_t.
    pub signal: SignalSettings,
    /// R_total.
    pub reward: RewardSettings,
    /// When an episode ends early.
    pub termination: TerminationSettings,
    /// How π is optimized.
    pub ppo: PpoSettings,
    /// Which motion is kept.
    pub kept: KeptSettings,
    /// How the scene is indexed.
    pub scene: crate::scene::SceneSettings,
    /// E.
    pub editor: EditorSettings,
}

/// S (LAMA, section 3.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthesizerSettings {
    /// N: frames between two searches (released: 10).
    pub search_every: usize,
    /// w_f².
    pub weights: FeatureWeights,
    /// A transition must be cheaper than playing on by this share of the cost (0 = the paper: always the nearest).
    pub reluctance: f32,
    /// A sit or stop is refused when its end misses the cue by more than this: metres (released: 0.32)…
    pub refuse_position: f32,
    /// …radians…
    pub refuse_direction: f32,
    /// …metres of pelvis height…
    pub refuse_height: f32,
    /// …or when C_tr + C_vel, the cost of the posture itself, exceeds this.
    pub refuse_posture: f32,
    /// Seconds that the motion goes on after the action is complete.
    pub hold_seconds: f32,
}

impl SynthesizerSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "synthesizer",
            SynthesizerSettings {
                search_every: 1..=300,
                reluctance: 0.0..=1e3,
                refuse_position: 0.0..=1e3,
                refuse_direction: 0.0..=1e3,
                refuse_height: 0.0..=1e3,
                refuse_posture: 0.0..=1e6,
                hold_seconds: 0.0..=600.0,
            },
            free { weights }
        );
        self.weights.validate()
    }
}

impl Default for SynthesizerSettings {
    fn default() -> Self {
        Self {
            search_every: 10,
            weights: FeatureWeights::default(),
            reluctance: 0.15,
            refuse_position: 0.30,
            refuse_direction: 0.5,
            refuse_height: 0.08,
            refuse_posture: 1.2,
            hold_seconds: 1.0,
        }
    }
}

/// The state s_t (LAMA, section 3.2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StateSettings {
    /// Joint rotations and their velocities in s^body, 6D (the paper); without them s^body is the
    /// end effectors' places and velocities, the up vector, the height and the contacts.
    pub joint_rotations: bool,
    /// g_occ: cells a side (released: 5).
    pub view_cells: usize,
    /// Spacing of the cells, metres, one view each (released: 1 % of the scene box, one view).
    pub view_spacing: Vec<f32>,
    /// g_root: the place in the scene as part of the state (the paper). A policy that knows it
    /// remembers places; one that does not can be used elsewhere.
    pub scene_position: bool,
    /// The way to the cue along the clear floor.
    pub clear_path: bool,
}

impl StateSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "state",
            StateSettings { view_cells: 1..=64, view_spacing: 0.01..=10.0 },
            free { joint_rotations, scene_position, clear_path }
        );
        check_length(&self.view_spacing, "state", "view_spacing", 0..=8)
    }
}

impl Default for StateSettings {
    fn default() -> Self {
        Self {
            joint_rotations: false,
            view_cells: 9,
            view_spacing: vec![0.15, 0.45],
            scene_position: false,
            clear_path: true,
        }
    }
}

/// How a^future is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FutureForm {
    /// The root's place after 10, 20 and 30 frames (the paper).
    Points,
    /// Its place and facing after 30 frames; a smooth curve fills in the rest (released: one planar goal).
    Goal,
}

/// The action a_t (LAMA, section 3.2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SignalSettings {
    /// How a^future is given.
    pub future_form: FutureForm,
    /// Farthest place of a^future, metres (released: 1.9).
    pub reach: f32,
    /// Largest turn of a^future, radians.
    pub largest_turn: f32,
    /// Radians of posture offset for one unit of the network's output (released: 0.2).
    pub offset_scale: f32,
    /// Largest posture offset, radians (released: 0.7 π).
    pub largest_offset: f32,
    /// a^offset at all (the ablation switches it off).
    pub posture_offset: bool,
    /// The policy's mean is the step along the shortest clear path plus what the network adds
    /// (residual policy learning); without it the network starts from nothing, as the paper's.
    pub propose_clear_path: bool,
    /// Walking pace of that proposal, m/s.
    pub pace: f32,
}

impl SignalSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "signal",
            SignalSettings {
                reach: 0.1..=10.0,
                largest_turn: 0.05..=10.0,
                offset_scale: 1e-3..=10.0,
                largest_offset: 0.0..=10.0,
                pace: 0.1..=5.0,
            },
            free { future_form, posture_offset, propose_clear_path }
        );
        Ok(())
    }
}

impl Default for SignalSettings {
    fn default() -> Self {
        Self {
            future_form: FutureForm::Goal,
            reach: 1.6,
            largest_turn: 2.2,
            offset_scale: 0.2,
            largest_offset: 0.7 * std::f32::consts::PI,
            posture_offset: true,
            propose_clear_path: true,
            pace: 1.05,
        }
    }
}

/// R_total and its terms (LAMA, eqs. 3–8).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RewardSettings {
    /// w_tr, w_act, w_reg (released: 0.4, 0.4, 0.2).
    pub w_tr: f32,
    /// Weight of R_act.
    pub w_act: f32,
    /// Weight of R_reg.
    pub w_reg: f32,
    /// r_coli at all (the ablation switches it off).
    pub collision: bool,
    /// 1/σ_coli² (released: 0.35).
    pub collision_rate: f32,
    /// w_b of legs and arms (released: 0.7, 0.3), and of feet, torso and head (the paper: 0).
    pub leg_weight: f32,
    /// w_b of the arms.
    pub arm_weight: f32,
    /// w_b of feet, torso and head.
    pub body_weight: f32,
    /// Crossings lower than this over the floor are not counted, metres (released: 0.10).
    pub ignore_below: f32,
    /// r_pos along the clear floor instead of as the crow flies.
    pub geodesic: bool,
    /// σ_root, metres.
    pub sigma_root: f32,
    /// σ_th of r_vel, metres a frame (released: 0.045).
    pub velocity_threshold: f32,
    /// σ_inter, metres, and the same for the facing, radians.
    pub sigma_inter: f32,
    /// The same for the facing, radians.
    pub sigma_facing: f32,
    /// σ²_Δt, σ²_Δv (released: 0.17, 0.10), on C_tr and C_vel; 0 for the ablation without smoothness.
    pub transition_rate: f32,
    /// σ²_Δv, on C_vel.
    pub velocity_rate: f32,
    /// σ_reg, radians.
    pub sigma_reg: f32,
    /// Weight of a completed action, in decisions: without it the policy would rather go on collecting R_tr.
    pub action_scale: f32,
    /// Taken from the reward of each decision: the discount alone hardly tells a long way round from a short one.
    pub time_cost: f32,
}

impl RewardSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "reward",
            RewardSettings {
                w_tr: -1e3..=1e3,
                w_act: -1e3..=1e3,
                w_reg: -1e3..=1e3,
                collision_rate: 0.0..=1e3,
                leg_weight: 0.0..=1e3,
                arm_weight: 0.0..=1e3,
                body_weight: 0.0..=1e3,
                ignore_below: 0.0..=10.0,
                sigma_root: 0.01..=1e3,
                velocity_threshold: 1e-4..=10.0,
                sigma_inter: 1e-3..=1e3,
                sigma_facing: 1e-3..=1e3,
                transition_rate: 0.0..=1e3,
                velocity_rate: 0.0..=1e3,
                sigma_reg: 1e-3..=1e3,
                action_scale: 0.0..=1e4,
                time_cost: 0.0..=1e3,
            },
            free { collision, geodesic }
        );
        Ok(())
    }
}

impl Default for RewardSettings {
    fn default() -> Self {
        Self {
            w_tr: 0.4,
            w_act: 0.4,
            w_reg: 0.2,
            collision: true,
            collision_rate: 0.35,
            leg_weight: 0.7,
            arm_weight: 0.3,
            body_weight: 0.3,
            ignore_below: 0.10,
            geodesic: true,
            sigma_root: 2.5,
            velocity_threshold: 0.018,
            sigma_inter: 0.3,
            sigma_facing: 0.5,
            transition_rate: 0.17,
            velocity_rate: 0.10,
            sigma_reg: 1.0,
            action_scale: 30.0,
            time_cost: 0.0,
        }
    }
}

/// Early termination (LAMA, supplementary "Acceleration Techniques").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TerminationSettings {
    /// Mean r_coli of 5 frames below this (released: 0.04).
    pub collision: f32,
    /// Mean root step of 50 frames below this, metres a frame (released: 0.03).
    pub stall_step: f32,
    /// Frames over which that is looked at.
    pub stall_frames: usize,
    /// Frames of an episode at the most.
    pub longest: usize,
}

impl TerminationSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "termination",
            TerminationSettings {
                collision: 0.0..=1.0,
                stall_step: 0.0..=1.0,
                stall_frames: 1..=10_000,
                longest: 1..=20_000,
            },
            free {}
        );
        Ok(())
    }
}

impl Default for TerminationSettings {
    fn default() -> Self {
        Self { collision: 0.04, stall_step: 0.006, stall_frames: 50, longest: 900 }
    }
}

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
    /// Weight of the entropy in the objective (the paper: none).
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
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
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
    /// What makes one motion better than another.
    pub weights: CostWeights,
}

impl KeptSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
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
    /// Posture offset, per squared radian and second.
    pub offset: f32,
}

impl CostWeights {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
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
                offset: ANY,
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
            offset: 0.02,
        }
    }
}

/// E, the motion editor (LAMA, section 3.6; supplementary, "Motion Editing").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EditorSettings {
    /// Fit a synthesized sit to its seat and carry hands along their manipulation cues. Without it the motion is the
    /// controller's own.
    pub fit: bool,
    /// Search the manifold before the finishing pass (the ablation switches it off).
    pub manifold: bool,
    /// Adam's learning rate (0.005) and most steps (500).
    pub learning_rate: f32,
    /// Most steps of Adam.
    pub steps: usize,
    /// The search stops once every target is this near, metres. The finishing pass takes the rest.
    pub met: f32,
    /// w_p, w_f, w_r, w_Δr (released, for manipulation: 7, 6, 1, 10).
    pub w_pos: f32,
    /// w_f.
    pub w_foot: f32,
    /// w_r.
    pub w_root: f32,
    /// w_Δr.
    pub w_root_velocity: f32,
    /// Ours: weight of what trembles in the changed rotations.
    pub w_smooth: f32,
    /// An edit fades in before the first frame that asks for it and out after the last, seconds.
    pub blend_seconds: f32,
    /// Seconds of a reach of no length, and what each metre adds to it; a return takes as long.
    pub reach_seconds: f32,
    /// What each metre adds to it.
    pub reach_seconds_per_metre: f32,
}

impl EditorSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "editor",
            EditorSettings {
                learning_rate: 0.0..=1.0,
                steps: 0..=100_000,
                met: 0.0..=10.0,
                w_pos: 0.0..=1e4,
                w_foot: 0.0..=1e4,
                w_root: 0.0..=1e4,
                w_root_velocity: 0.0..=1e4,
                w_smooth: 0.0..=1e4,
                blend_seconds: 0.0..=60.0,
                reach_seconds: 0.0..=60.0,
                reach_seconds_per_metre: 0.0..=60.0,
            },
            free { fit, manifold }
        );
        Ok(())
    }
}

impl Default for EditorSettings {
    fn default() -> Self {
        Self {
            fit: true,
            manifold: true,
            learning_rate: 0.005,
            steps: 500,
            met: 0.03,
            w_pos: 7.0,
            w_foot: 6.0,
            w_root: 1.0,
            w_root_velocity: 10.0,
            w_smooth: 1.0,
            blend_seconds: 0.8,
            reach_seconds: 0.6,
            reach_seconds_per_metre: 0.3,
        }
    }
}

impl Settings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number, by section and field.
    pub fn validate(&self) -> Result<()> {
        let Self { synthesizer, state, signal, reward, termination, ppo, kept, scene, editor } = self;
        synthesizer.validate()?;
        state.validate()?;
        signal.validate()?;
        reward.validate()?;
        termination.validate()?;
        ppo.validate()?;
        kept.validate()?;
        scene.validate()?;
        editor.validate()
    }

    /// Names of the presets.
    pub const PRESETS: [&'static str; 2] = ["default", "paper"];

    /// A preset by its name.
    ///
    /// # Errors
    /// [`Error::Input`] for a name that is none of [`Settings::PRESETS`].
    pub fn preset(name: &str) -> Result<Self> {
        let mut settings = Self::default();
        match name {
            "default" => {}
            "paper" => {
                settings.synthesizer.reluctance = 0.0;
                settings.state = StateSettings {
                    joint_rotations: true,
                    view_cells: 5,
                    view_spacing: vec![0.07],
                    scene_position: true,
                    clear_path: false,
                };
                settings.signal.future_form = FutureForm::Points;
                settings.signal.reach = 1.9;
                settings.signal.propose_clear_path = false;
                settings.reward.geodesic = false;
                settings.reward.body_weight = 0.0;
                settings.ppo.policy_layers = vec![256; 4];
                settings.ppo.value_layers = vec![256; 2];
                settings.ppo.tuples = 30_000;
                settings.ppo.epochs = 5;
                settings.ppo.solved = 0.9;
                settings.ppo.log_std_future = 0.0;
                settings.ppo.log_std_offset = 0.0;
                settings.ppo.updates = 200;
                settings.ppo.vary_start = 0.0;
                settings.ppo.prior = false;
                settings.kept.rollouts = 1;
                settings.kept.rounds = 0;
                settings.kept.more_rounds = 0;
                settings.kept.narrow_offset = 0.0;
            }
            other => {
                return Err(Error::input(format!(
                    "There is no preset '{other}'; choose one of {}.",
                    Self::PRESETS.join(", ")
                )));
            }
        }
        Ok(settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_preset_is_the_papers_table() {
        let ppo = Settings::preset("paper").expect("a preset").ppo;
        assert_eq!((ppo.policy_rate, ppo.value_rate), (2e-4, 1e-3));
        assert_eq!((ppo.discount, ppo.lambda, ppo.clip), (0.95, 0.95, 0.2));
        assert_eq!((ppo.tuples, ppo.batch), (30_000, 512));
        assert_eq!((ppo.policy_layers, ppo.value_layers), (vec![256; 4], vec![256; 2]));
    }

    #[test]
    fn unknown_fields_and_presets_are_named() {
        let error = serde_json::from_str::<Settings>(r#"{"ppo": {"gama": 0.9}}"#).unwrap_err();
        assert!(error.to_string().contains("gama"), "{error}");
        assert!(Settings::preset("fast").unwrap_err().to_string().contains("fast"));
    }
}
