//! R_total = w_tr R_tr + w_act R_act + w_reg R_reg (LAMA, eqs. 3–8), a function a symbol.

use crate::library::feature::{FUTURE, PoseFeature, UP, VELOCITY};
use crate::math::rotation::wrap_angle;
use crate::motion::{BODY_BOXES, Limb};
use crate::settings::RewardSettings;

/// r_coli = exp(-1/σ_coli² Σ_b w_b ρ(b, W)), LAMA eq. 4. `counts`: ρ of each of [`BODY_BOXES`].
pub(crate) fn collision_reward(counts: &[u32; BODY_BOXES.len()], settings: &RewardSettings) -> f32 {
    if !settings.collision {
        return 1.0;
    }
    let weighted: f32 = BODY_BOXES
        .iter()
        .zip(counts)
        .map(|(node, &count)| {
            let weight = match node.limb {
                Limb::Leg => settings.leg_weight,
                Limb::Arm => settings.arm_weight,
                Limb::Foot | Limb::Torso | Limb::Head => settings.body_weight,
            };
            weight * count as f32
        })
        .sum();
    (-settings.collision_rate * weighted).exp()
}

/// r_pos = exp(-‖p_0 - q‖²/σ_root²), LAMA eq. 5, on the way that is left in metres.
///
/// As the crow flies it has local minima behind every table, so by default the way is the one along
/// the clear floor, and its first power: the square is flat a few metres away.
pub(crate) fn position_reward(distance: f32, settings: &RewardSettings) -> f32 {
    let s = distance / settings.sigma_root;
    if settings.geodesic { (-s).exp() } else { (-s * s).exp() }
}

/// r_vel, LAMA eq. 6: 1 from σ_th on, and a share that grows with the square below. `step`: metres a frame.
///
/// The paper's σ_vel is chosen so that the two meet at σ_th.
pub(crate) fn velocity_reward(step: f32, settings: &RewardSettings) -> f32 {
    let s = step / settings.velocity_threshold;
    (s * s).min(1.0)
}

/// r_inter = exp(-Σ ‖p_j - q_j‖²/σ_inter²), LAMA eq. 7, and the facing, which the cue asks for too.
pub(crate) fn interaction_reward(distances: &[f32], facing: f32, settings: &RewardSettings) -> f32 {
    let sum: f32 = distances.iter().map(|d| d * d).sum();
    let f = wrap_angle(facing) / settings.sigma_facing;
    (-sum / settings.sigma_inter.powi(2) - f * f).exp()
}

/// r_Δt · r_Δv = exp(-σ²_Δt C_tr) · exp(-σ²_Δv C_vel), LAMA eq. 8.
pub(crate) fn transition_reward(cost: TransitionCost, settings: &RewardSettings) -> f32 {
    (-settings.transition_rate * cost.posture - settings.velocity_rate * cost.velocity).exp()
}

/// R_reg = exp(-1/σ_reg² (‖m̂_t - m_t‖² + ‖m_t - m_{t-1}‖²)). Squared radians, mean over a joint.
pub(crate) fn regularization_reward(offset: f32, change: f32, settings: &RewardSettings) -> f32 {
    (-(offset + change) / settings.sigma_reg.powi(2)).exp()
}

/// C_tr and C_vel: the parts of a transition's feature distance (LAMA, after eq. 8).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TransitionCost {
    /// C_tr: of p_j, θ_up and c.
    pub posture: f32,
    /// C_vel: of ṗ_j.
    pub velocity: f32,
}

/// C_tr, C_vel between a query and a database frame; `weights`: w_f.
pub(crate) fn transition_cost(query: &PoseFeature, matched: &PoseFeature, weights: &[f32]) -> TransitionCost {
    let part = |range: std::ops::Range<usize>| -> f32 {
        range.map(|i| (weights[i] * (query[i] - matched[i])).powi(2)).sum()
    };
    TransitionCost { posture: part(0..VELOCITY) + part(UP..FUTURE), velocity: part(VELOCITY..UP) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::feature::CONTACT;

    fn close(a: f32, b: f32) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }

    #[test]
    fn equations_by_hand() {
        let s = RewardSettings { body_weight: 0.0, sigma_root: 2.0, ..RewardSettings::default() };
        let mut counts = [0; BODY_BOXES.len()];
        counts[0] = 2; // a leg
        counts[4] = 1; // an arm
        counts[12] = 9; // the head, weight 0
        close(collision_reward(&counts, &s), (-0.35f32 * (0.7 * 2.0 + 0.3)).exp());
        close(collision_reward(&counts, &RewardSettings { collision: false, ..s.clone() }), 1.0);
        close(position_reward(1.0, &s), (-0.5f32).exp());
        close(position_reward(1.0, &RewardSettings { geodesic: false, ..s.clone() }), (-0.25f32).exp());
        close(velocity_reward(s.velocity_threshold / 2.0, &s), 0.25);
        close(velocity_reward(1.0, &s), 1.0);
        close(interaction_reward(&[0.3, 0.0], 0.0, &s), (-1.0f32).exp());
        close(transition_reward(TransitionCost { posture: 1.0, velocity: 2.0 }, &s), (-0.37f32).exp());
        close(regularization_reward(0.5, 0.5, &RewardSettings { sigma_reg: 1.0, ..s }), (-1.0f32).exp());
    }

    #[test]
    fn transition_cost_is_the_subpart_of_the_feature_distance() {
        let weights = vec![2.0; FUTURE];
        let (a, mut b) = ([0.0; FUTURE], [0.0; FUTURE]);
        b[0] = 1.0;
        b[VELOCITY] = 3.0;
        b[CONTACT] = 0.5;
        let cost = transition_cost(&a, &b, &weights);
        close(cost.posture, 4.0 + 1.0);
        close(cost.velocity, 36.0);
    }
}
