//! What a run tells about itself; `docs/report.md` describes the JSON.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::controller::optimize::UpdateFigures;
use crate::cue::Moments;
use crate::editor::TaskEditFigures;
use crate::figures::{BodyFigures, OthersFigures, StyleFigures};
use crate::hands::{OpenedFigures, ThingFigures};
use crate::metrics::{FootFigures, PenetrationFigures, Residual, SpeedFigures};
use crate::settings::Settings;

/// Version of the report's layout.
pub const REPORT_VERSION: u32 = 1;

/// Which policy a run began with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PolicySource {
    /// Random weights: the paper's way.
    Scratch,
    /// The one that ships with Oncue.
    Prior,
    /// One that was stored when an earlier task in the scene had optimized it.
    #[serde(rename = "kept")]
    Stored,
}

/// What is told of one step of a performance. All frames are the whole motion's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// The cue's name.
    pub cue: String,
    /// The frame in which the step before has ended.
    pub first_frame: usize,
    /// When what happens.
    #[serde(flatten)]
    pub moments: Moments,
    /// The frame on which the cue was to be met; none where no time was asked for.
    #[serde(default)]
    pub asked_frame: Option<usize>,
    /// How much later it is met, seconds; negative where it is sooner.
    #[serde(default)]
    pub late_s: Option<f32>,
    /// How long the person waits where the step before has ended, so as not to be there too soon, seconds.
    #[serde(default)]
    pub waits_s: f32,
    /// How much longer the way there takes than it would by itself, seconds; negative where the person hurries.
    #[serde(default)]
    pub dawdles_s: f32,
    /// What the editor did, in frames of the step's own, as it was before it was given another pace.
    pub edited: Option<TaskEditFigures>,
    /// Frames that the person stays, before setting out, for others to pass.
    #[serde(default, skip_serializing_if = "is_none")]
    pub waited: usize,
    /// Where the policy came from that played it.
    pub policy_source: PolicySource,
    /// Updates of this run; 0 where the policy that was there served.
    pub updates: usize,
    /// Metres the root travelled.
    pub path_m: f32,
    /// Metres of the shortest clear way.
    pub shortest_path_m: f32,
}

/// What is told of something that the person was to look at. Frames of the whole motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LookReport {
    /// The cue's name.
    pub look: String,
    /// From and to before which frame.
    pub first: usize,
    /// To before which.
    pub end: usize,
    /// On so many of them the gaze meets it, within 5°.
    pub met: usize,
    /// On so many the head is on its way there.
    pub turning: usize,
    /// On so many it is behind the person.
    pub behind: usize,
    /// On so many the head does not get there: it is too high or low, or the body or what stands around is in the way.
    pub held: usize,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // As serde calls it.
fn is_none(frames: &usize) -> bool {
    *frames == 0
}

/// The report of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Rises when a field changes its meaning.
    pub report_version: u32,
    /// Version of the core.
    pub version: String,
    /// The request's seed.
    pub seed: u64,
    /// Checksum of the motion library.
    pub library_checksum: String,
    /// Every setting that was used.
    pub settings: Settings,
    /// Every cue was met, nothing ended early, and no limb is in the body or the scene for more than a brief touch
    /// (`settings.report`).
    pub success: bool,
    /// In words what went wrong; empty when nothing did.
    pub problems: Vec<String>,
    /// How each cue was met.
    pub cues: Vec<Residual>,
    /// The frame from which on the person sits down or comes to stand; none where it never did.
    pub action_from: Option<usize>,
    /// What was played of a performance, cue after cue; empty for the run of one cue.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<StepReport>,
    /// What became of things that were taken; empty where none was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub things: Vec<ThingFigures>,
    /// What hands opened; empty where there was nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub opened: Vec<OpenedFigures>,
    /// What the person was to look at; missing where that is nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub looks: Vec<LookReport>,
    /// How the person is in others of the shot; none of who is alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub others: Option<OthersFigures>,
    /// How well the feet stand.
    pub foot: FootFigures,
    /// How often the body is in the scene.
    pub penetration: PenetrationFigures,
    /// How fast and how hard the joints move, beside the library.
    pub speed: SpeedFigures,
    /// What an eye sees first: the own body, joints, feet, the whole body in the scene.
    pub body: BodyFigures,
    /// How the person walks, sets off, sits down and sits.
    #[serde(default)]
    pub style: StyleFigures,
    /// What the editor did; none where it is switched off or the action was not completed.
    pub edited: Option<TaskEditFigures>,
    /// Frames of the motion, 30 Hz.
    pub frames: usize,
    /// Metres the root travelled, and the shortest clear path.
    pub path_m: f32,
    /// Metres of the shortest clear way.
    pub shortest_path_m: f32,
    /// Seconds of each stage, by name.
    pub seconds: BTreeMap<String, f32>,
    /// Where the policy came from that played the motion.
    pub policy_source: PolicySource,
    /// Updates of this run; 0 where the policy that was there served the task.
    pub updates: usize,
    /// Decisions that were played for learning.
    pub environment_steps: usize,
    /// The same by the second of rolling out.
    pub environment_steps_per_second: f32,
    /// Rollouts the kept motion was chosen from, and how many of them met the cue.
    pub rollouts: usize,
    /// Those of them that met the cue.
    pub rollouts_succeeded: usize,
    /// One point an update.
    pub curve: Vec<UpdateFigures>,
}
