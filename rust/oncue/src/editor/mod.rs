//! The motion editor E (LAMA, sections 3.6 and 4.3; supplementary, "Motion Editing").
//!
//! ```text
//! Motion ──► window X ──► Ψ (encoder) ──► z, optimized ──► Ψ⁻¹ (decoder) ──► X ──► Motion
//! ```
//!
//! An edit asks for `constraint`s. `latent` searches the [`crate::manifold`] for them; the `body_solver` takes
//! what is left. Who asks is `seat` (the action cue), `manipulation` (the hands' cues) and `resolve` (the artist);
//! `first_step` prepares the first step and `free_limbs` takes limbs and trunk out of the body and the scene; `task` is the editor's part of the main job, and [`plain_ik`] what it is compared with.

pub(crate) mod constraint;
pub(crate) mod edit;
pub(crate) mod first_step;
mod foot_following;
pub(crate) mod free_limbs;
pub(crate) mod latent;
pub(crate) mod manipulation;
pub(crate) mod plain_ik;
pub(crate) mod resolve;
pub(crate) mod seat;
pub(crate) mod task;

pub use constraint::{Constraint, check_constraints};
pub use edit::{ConstraintFigures, EditFigures, EditedMotion};
pub use latent::{SearchFigures, manifold_distance};
pub use manipulation::{Manipulated, ManipulationFigures, check_manipulations, lengthened, manipulate};
pub use plain_ik::plain_ik;
pub use resolve::{Key, Wishes};
pub use seat::{Seat, SeatFigures, SeatFit};
pub use task::{TaskEditFigures, edit_for_task};

use crate::error::Result;
use crate::manifold::Manifold;
use crate::motion::Motion;
use crate::progress::Progress;
use crate::settings::EditorSettings;

/// E(M): the motion edited so that it meets what was wished for (LAMA, section 3.6), along `manifold`, or by the finishing
/// pass alone where there is none.
///
/// Frames outside the touched span are those of `motion`, bit for bit.
///
/// # Errors
/// `Input` for contradictions, paths that jump, bones that are none and ranges outside the motion; `Unreachable`, by how
/// much and which way to move the cue; `Cancelled`. The sentence names the constraint, the frame and the value.
pub fn edit_motion(
    motion: &Motion,
    wishes: &Wishes,
    manifold: Option<&Manifold>,
    settings: &EditorSettings,
    progress: &Progress,
) -> Result<EditedMotion> {
    resolve::resolve(manifold, motion, wishes, settings, progress)
}

/// The manifold that ships with Oncue; `None` where a build left it out.
pub fn shipped_manifold() -> Option<&'static Manifold> {
    Manifold::shipped().ok()
}
