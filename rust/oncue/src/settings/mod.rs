//! Every constant of the paper as a field, with its source; two presets.
//!
//! `Settings::preset("paper")` is the paper's table and terms (the released value where the paper gives
//! none); `Settings::default()` is what Oncue runs: the same algorithm, started from the shortest clear
//! path, with a view of a few metres, stopped when the task is solved.
//! `docs/decisions/` says why each default departs from the paper.

mod controller;
mod editor;
mod optimization;
mod report;
mod synthesizer;

pub use controller::{FutureForm, RewardSettings, SignalSettings, StateSettings, TerminationSettings};
pub use editor::EditorSettings;
pub use optimization::{CostWeights, KeptSettings, PpoSettings};
pub use report::ReportSettings;
pub use synthesizer::SynthesizerSettings;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

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
    /// What the report lets pass.
    pub report: ReportSettings,
}

impl Settings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number, by section and field.
    pub fn validate(&self) -> Result<()> {
        let Self { synthesizer, state, signal, reward, termination, ppo, kept, scene, editor, report } = self;
        synthesizer.validate()?;
        state.validate()?;
        signal.validate()?;
        reward.validate()?;
        termination.validate()?;
        ppo.validate()?;
        kept.validate()?;
        scene.validate()?;
        editor.validate()?;
        report.validate()
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
                settings.synthesizer.offset_everywhere = true;
                settings.synthesizer.life = 0.0;
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
