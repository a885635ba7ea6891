//! The constants of what A sees, says and is rewarded for (LAMA, section 3.2 and supplementary).

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::range::{check_length, check_ranges};

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
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
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
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
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
            pace: 1.15,
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
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
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
    /// An episode ends when the mean r_coli of 5 frames is below this (released: 0.04); r_coli is 1 where `reward.collision` is
    /// off.
    pub collision: f32,
    /// An episode ends when the mean root step of `stall_frames` is below this, metres a frame (released: 0.03).
    pub stall_step: f32,
    /// Frames over which that is looked at.
    pub stall_frames: usize,
    /// Frames of an episode at the most.
    pub longest: usize,
}

impl TerminationSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
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
