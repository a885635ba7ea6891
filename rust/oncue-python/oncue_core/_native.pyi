"""Types of the compiled module; import from `oncue_core`."""

import os
from collections.abc import Mapping, Sequence
from types import GenericAlias
from typing import Any, Generic, Literal, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from .errors import OncueError
from .types import (
    ActionCue,
    BodyFigures,
    Capture,
    CarriedThing,
    Clip,
    Constraint,
    EditFigures,
    FootFigures,
    Key,
    LearningFigures,
    ManifoldFigures,
    ManipulationCue,
    Measured,
    Moments,
    MotionFigures,
    Passing,
    Performance,
    Point,
    PolicyOrigin,
    ProgressSnapshot,
    Report,
    RigMapping,
    Robustness,
    Settings,
    Skeleton,
    StyleFigures,
    Summary,
    Task,
    Ways,
)

__all__ = [
    "EditedMotion",
    "Job",
    "Library",
    "Manifold",
    "MovingObject",
    "Performed",
    "Policy",
    "SceneIndex",
    "Synthesis",
    "__version__",
    "build_library",
    "check_task",
    "cue_types",
    "default_settings",
    "edit_motion",
    "find_ways",
    "fit_keys",
    "fit_seat",
    "index_scene",
    "map_rig",
    "measure_motion",
    "measure_performance",
    "motion_figures",
    "optimize_policy",
    "pass_moving",
    "perform",
    "perform_together",
    "plain_ik",
    "practice_room",
    "presets",
    "robustness",
    "skeleton",
    "synthesize",
    "train_manifold",
]

__version__: str

_T_co = TypeVar("_T_co", covariant=True)

@final
class Job(Generic[_T_co]):
    """Work that runs on a thread of its own. Dropping the handle cancels it."""

    @classmethod
    def __class_getitem__(cls, key: Any) -> GenericAlias: ...
    def progress(self) -> ProgressSnapshot: ...
    def cancel(self) -> None:
        """Asks the work to stop; `result` then raises Cancelled unless the work was done before."""
    def done(self) -> bool: ...
    def wait(self, timeout_s: float) -> bool:
        """Waits at most `timeout_s` seconds; whether the work is done. Other Python threads run meanwhile."""
    def result(self) -> _T_co:
        """Waits for the work, and gives its result or raises what it raised; the same each time."""

@final
class Library:
    """Clips to match against, on the unified skeleton at 30 Hz. Immutable."""

    @staticmethod
    def starter() -> Library:
        """The starter library: procedural motion, made by rule; the same each time. Takes seconds.

        `build_library([])` gives the same as a job.
        """
    @staticmethod
    def read(path: str | os.PathLike[str]) -> Library:
        """Reads a library file. OSError, and DataFileError for one that is foreign, too new, cut off or damaged."""
    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the library file; an earlier one stays as it was until the new one is whole. OSError."""
    def merged(self, other: Library) -> Library:
        """A library with this one's clips and then the other's."""
    @property
    def checksum(self) -> str:
        """BLAKE3 of the clips, hexadecimal: the same for the same clips, wherever they are kept."""
    @property
    def frame_count(self) -> int:
        """Frames over all clips."""
    @property
    def clip_count(self) -> int:
        """Clips, mirrored copies included."""
    @property
    def clip_names(self) -> list[str]:
        """The clips' names, in their order: a file's stem, or what the starter library calls it."""
    def clip(self, clip: int) -> Clip:
        """Clip number `clip`: its motion, and what happens in it. InputError for a number that no clip has."""
    def write_bvh(self, clip: int, path: str | os.PathLike[str]) -> None:
        """Writes clip number `clip` as a .bvh file; an earlier one stays as it was until the new one is whole.

        On the unified skeleton at 30 frames a second, in centimetres, Y up, facing +Z at rest; in Blender's importer
        that is a scale of 0.01 and nothing else. InputError for a number that no clip has, OSError.
        """
    def foot_figures(self) -> FootFigures:
        """The foot figures of the library's own walking, by the same measures as a report's `foot`."""
    def body_figures(self) -> BodyFigures:
        """What an eye sees first in the clips, mirrored copies left out, by the same measures as a report's `body`.

        All clips together: where in which clip is not told, and there is no scene.
        """
    def style_figures(self, source: Literal["mocap", "procedural"] | None = None) -> StyleFigures:
        """How people walk, set off, sit down, sit and get up in the clips, by the same measures as a report's `style`.

        Mirrored copies left out; of captured or of made clips alone where a source is given.
        """
    def summary(self) -> Summary:
        """Seconds of each action, by where they come from."""

def build_library(
    paths: Sequence[str | os.PathLike[str]], settings: Settings | None = None
) -> Job[tuple[Library, list[Capture]]]:
    """Builds a library from .bvh files and folders; gives it with what each file gave to it.

    With no paths it is the starter's. Settings: `mirror` (bool), `starter` ("all", "missing": the actions of
    which the captures have too little to work with, or "none"), `mapping` (a mapping file for all the files, see
    docs/captures.md, or None).
    From the job: OSError for a path that is not there, InputError for a folder without .bvh files or where no file
    could be used.
    """

def practice_room(seed: int) -> tuple[NDArray[np.float32], NDArray[np.uint32], list[ActionCue]]:
    """A room made by rule: positions (n, 3), world, metres, triangles (m, 3), and the cues that it offers."""

@final
class Manifold:
    """Ψ and Ψ⁻¹: the autoencoder that motions are edited in (LAMA, section 3.6). Immutable."""

    @staticmethod
    def shipped() -> Manifold:
        """The manifold that ships with Oncue; docs/manifold.md tells the data that it was made from."""
    @staticmethod
    def read(path: str | os.PathLike[str]) -> Manifold:
        """Reads a manifold's file. OSError, and DataFileError for one that is foreign, too new, damaged or of another
        skeleton."""
    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the manifold's file; an earlier one stays as it was until the new one is whole. OSError."""
    @property
    def channels(self) -> int:
        """Channels of each layer's output; the latent vector of 120 frames has 15 times as many numbers."""
    @property
    def figures(self) -> ManifoldFigures:
        """How it was trained, and its errors on clips that it was not trained on."""

def train_manifold(
    library: Library,
    settings: Settings | None = None,
    seed: int = 0,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Job[Manifold]:
    """Trains a manifold on a library's clips; the same seed gives the same manifold on any number of cores.

    Settings: `channels`, `epochs`, `batch` and the others of `figures["settings"]`; what is left out keeps its default.
    With a `checkpoint` the training is written to that file after every epoch, and goes on from there when it is called
    again. InputError for unknown settings at once; from the job for settings out of range and for a library of fewer
    than three clips that are long enough, DataFileError for the checkpoint of another training, OSError.
    """

@final
class SceneIndex:
    """A scene's triangles, indexed for collision and for finding ways. Immutable."""

    @property
    def triangle_count(self) -> int:
        """Triangles that have an area."""
    @property
    def bounds(self) -> tuple[Point, Point]:
        """Smallest and largest corner, world, metres."""
    @property
    def fingerprint(self) -> str:
        """BLAKE3 of the triangles, hexadecimal: changes when anything in the scene moves."""
    @property
    def floor_height(self) -> float:
        """World z of the level that is walked on, metres: the dominant one, or that of the task's start."""

def index_scene(
    positions: NDArray[np.float32],
    triangles: NDArray[np.uint32],
    settings: Settings | None = None,
    task: Task | Performance | Sequence[Performance] | None = None,
) -> Job[SceneIndex]:
    """Indexes a scene: `positions` (n, 3), world, metres, Z up; `triangles` (m, 3), indices of positions.

    With a task, a performance or several people's its floor is the level that carries the (first) start; without one
    the level that is the scene's largest.

    The arrays are copied before the call returns. InputError for arrays of another dtype or shape and for unknown
    settings at once; for meshes that cannot be indexed from the job.
    """

@final
class MovingObject:
    """A rigid mesh that moves in the scene by itself. Immutable."""

    def __new__(
        cls,
        name: str,
        positions: NDArray[np.float32],
        triangles: NDArray[np.uint32],
        translations: NDArray[np.float32],
        rotations: NDArray[np.float32],
    ) -> MovingObject:
        """`positions` (n, 3), world, metres, and `triangles` (m, 3) as it was read; for each frame (30 Hz) the
        `translations` (frames, 3) and `rotations` (frames, 4), w first, that take it to where it stands then. After the
        last it stands still. InputError for arrays of another dtype or shape."""
    @property
    def name(self) -> str:
        """The name that messages have."""

def pass_moving(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    objects: Sequence[MovingObject],
    floor: float,
    arms_may_touch: bool = False,
    most_wait: int = 0,
) -> Job[Passing]:
    """How a motion gets past what moves, each frame against where everything stands on it.

    `most_wait`: frames that the person may stand at the start until the way is free. InputError from the job for an
    object whose mesh or poses are none.
    """

def check_task(scene: SceneIndex, task: Task | Performance | Sequence[Performance]) -> None:
    """Returns where the person can get from the start to the cue, or to each of several, and do there what is asked.

    Of several people's performances also whether they start and end where they fit together. InputError with the reason
    otherwise. The synthesis asks the same first.
    """

def find_ways(scene: SceneIndex, task: Task | Performance | Sequence[Performance]) -> Job[Ways]:
    """The ways that people would walk, from the start to each cue in order, and where each would fail and why.

    They are the clear paths that the synthesis follows: world, metres, on the floor. Nothing is played, and a way that
    fails says nothing of those after it. InputError for what is no task at once; from the job for nothing.
    """

@final
class Policy:
    """An action controller that was optimized before. Immutable."""

    @staticmethod
    def prior() -> Policy:
        """The policy that ships with Oncue."""
    @staticmethod
    def read(path: str | os.PathLike[str]) -> Policy:
        """Reads a policy file. OSError, and DataFileError for one that is foreign, too new, cut off or damaged."""
    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the policy file; an earlier one stays as it was until the new one is whole. OSError."""
    def belongs_to(self, scene: SceneIndex, library_checksum: str) -> bool:
        """Whether it was optimized in this scene with the library of this checksum."""
    @property
    def origin(self) -> PolicyOrigin:
        """What it was optimized for."""

def optimize_policy(
    scene: SceneIndex,
    library: Library,
    tasks: Sequence[Task],
    settings: Settings | None = None,
    seed: int = 0,
    policy: Policy | None = None,
    generalized: bool = True,
) -> Job[tuple[Policy, list[LearningFigures]]]:
    """Optimizes one policy for the cues of `tasks`, from `policy` if given and of the same settings.

    `generalized`: from starts all over the floor (LAMA, section 3.5); else from the tasks' own starts. Gives the policy
    and its learning curve. InputError for no tasks.
    """

def robustness(
    scene: SceneIndex,
    library: Library,
    policy: Policy,
    task: Task,
    settings: Settings | None = None,
    test: Settings | None = None,
    seed: int = 0,
) -> Job[Robustness]:
    """The paper's robustness test: plays the policy towards the task's cue from a grid of starts over the whole floor.

    `test`: `spacing` of the grid in metres, `trials` from each start, how many of them are `needed`, and the `spread`
    of the actions (1: as optimized). InputError for a policy of other settings.
    """

@final
class Synthesis:
    """A motion and its report."""

    @property
    def root_positions(self) -> NDArray[np.float32]:
        """p_root: (frames, 3), world, metres."""
    @property
    def rotations(self) -> NDArray[np.float32]:
        """(frames, 22, 4), w first; [:, 0] in the world, the others relative to their parent."""
    @property
    def contacts(self) -> NDArray[np.float32]:
        """(frames, 2), left and right foot: 0 in the air, 0.5 near the floor, 1 planted."""
    @property
    def frame_rate(self) -> float:
        """Frames a second."""
    @property
    def report(self) -> Report:
        """What the run tells about itself; docs/report.md describes it."""
    @property
    def policy(self) -> Policy:
        """The policy that played it, for the next task in the scene."""

def synthesize(
    scene: SceneIndex,
    library: Library,
    task: Task,
    settings: Settings | None = None,
    seed: int = 0,
    policy: Policy | None = None,
    manifold: Manifold | None = None,
    stays: SceneIndex | None = None,
) -> Job[Synthesis]:
    """Synthesizes the motion of a task; the same seed, policy and manifold give the same motion on any number of cores.

    `policy`: one of the same scene and library. Where the prior fails and this one serves the task, nothing is
    optimized; else it is fine-tuned. `manifold`: what seat and hands are fitted along, another than the one that ships.
    `stays`: what the motion is measured in, where `scene` holds what will have moved by then.
    InputError for unknown settings and malformed tasks at once; from the job for a task that cannot be met, before
    anything is optimized.
    """

@final
class Performed:
    """A performance as it was made: all of it, one motion, and its report."""

    @property
    def root_positions(self) -> NDArray[np.float32]:
        """p_root: (frames, 3), world, metres."""
    @property
    def rotations(self) -> NDArray[np.float32]:
        """(frames, 22, 4), w first; [:, 0] in the world, the others relative to their parent."""
    @property
    def contacts(self) -> NDArray[np.float32]:
        """(frames, 2), left and right foot: 0 in the air, 0.5 near the floor, 1 planted."""
    @property
    def frame_rate(self) -> float:
        """Frames a second."""
    @property
    def report(self) -> Report:
        """What the run tells about itself; docs/report.md describes it."""
    @property
    def things(self) -> list[CarriedThing]:
        """The things that were taken, in the order in which they were."""

def perform(
    scene: SceneIndex,
    library: Library,
    performance: Performance,
    settings: Settings | None = None,
    seed: int = 0,
    policy: Policy | None = None,
    manifold: Manifold | None = None,
    earlier: Performed | None = None,
) -> Job[Performed]:
    """Plays a performance: cues that one person meets one after the other, getting up from seats on the way.

    `earlier`: what was made of the performance before; steps that follow from the same as then are taken from it, the
    rest is made anew. A step that cannot be played ends the performance: what lies before is kept, and
    `report["problems"]` says why. The others as for `synthesize`.
    InputError for malformed performances at once; from the job for a cue that can be seen not to be met, before
    anything is played.
    """

def perform_together(
    scene: SceneIndex,
    library: Library,
    performances: Sequence[Performance],
    settings: Settings | None = None,
    seed: int = 0,
    policy: Policy | None = None,
    manifold: Manifold | None = None,
    earlier: Sequence[Performed] = ...,
) -> Job[list[Performed | OncueError]]:
    """Plays the performances of several people in one shot, who begin at once; given in the order of `performances`.

    Each is made in turn, by where they start, and goes round those who were made before, waits for them or sits beside
    them. Whoever cannot be played is an error in their place, and the rest is played all the same. Where two are in one
    another, `report["others"]` and `report["problems"]` of both say so. The same seed gives the same shot, whatever the
    names and the order. `earlier`: people who were made before, of whom is taken what follows from the same as then.
    InputError for malformed performances at once; from the job, naming the person, for a cue that can be seen not to be
    met, and for two people who start or end where two do not fit. The others as for `perform`.
    """

@final
class EditedMotion:
    """An edited motion, and how its constraints were met."""

    @property
    def root_positions(self) -> NDArray[np.float32]:
        """p_root: (frames, 3), world, metres."""
    @property
    def rotations(self) -> NDArray[np.float32]:
        """(frames, 22, 4), w first; [:, 0] in the world, the others relative to their parent."""
    @property
    def contacts(self) -> NDArray[np.float32]:
        """(frames, 2), left and right foot: 0 in the air, 0.5 near the floor, 1 planted."""
    @property
    def frame_rate(self) -> float:
        """Frames a second."""
    @property
    def figures(self) -> EditFigures:
        """What is left of each constraint, the frames that may have changed, and where the hands' paths came to lie."""

def edit_motion(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    constraints: Sequence[Constraint] = ...,
    keys: Sequence[Key] = ...,
    manipulations: Sequence[ManipulationCue] = ...,
    scene: SceneIndex | None = None,
    floor: float = 0.0,
    settings: Settings | None = None,
    manifold: Manifold | None = None,
) -> Job[EditedMotion]:
    """Edits a motion (arrays as a synthesis gives them) so that it meets constraints, keys and hands' cues.

    Frames outside the touched span stay to the bit. Hands' cues come first, and lengthen the motion where the person
    is still; frames of constraints and keys are then those of the lengthened motion. `scene`: what a seated body is
    kept out of. `floor`: its height, metres. Settings: those of `synthesize`, of which `editor` counts. `manifold`:
    another than the one that ships.
    InputError for arrays of another shape or kind, unknown bones and fields at once; from the job for contradictions,
    paths that jump, ranges outside the motion, and what is out of reach, by how much and which way.
    """

def fit_seat(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    cue: ActionCue,
    complete: int,
    scene: SceneIndex | None = None,
    floor: float = 0.0,
    settings: Settings | None = None,
    manifold: Manifold | None = None,
) -> Job[EditedMotion]:
    """Fits a motion that sits down to its seat: pelvis and feet to the cue, thighs on the seat, back before its rest.

    `complete`: the frame from which on the person sits. Everything else as for `edit_motion`. InputError from the job
    where the seat or a foot's cue is out of reach, by how much and which way.
    """

def fit_keys(
    parents: Sequence[int],
    offsets: NDArray[np.float64],
    rests: NDArray[np.float64],
    limbs: Sequence[tuple[Sequence[int], Sequence[int]]],
    tolerances: NDArray[np.float64],
    planted: NDArray[np.bool_],
    drift: float,
    locations: NDArray[np.float64],
    rotations: NDArray[np.float64],
    played_locations: NDArray[np.float64] | None = None,
    played_rotations: NDArray[np.float64] | None = None,
    stays: NDArray[np.bool_] | None = None,
) -> list[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Few keys of Bezier curves for the channels of any bones: of each (frames, values, slopes before, slopes after).

    Between two keys a curve is the cubic whose handles lie at a third of the span; slopes are by the frame, and NaN on
    a side where the curves stay or there is none. Values are (keys, 4), w first; the first bone's (keys, 7), its
    location last. Any unit of length; angles in radians.

    `parents` come before their children, -1 for none; `offsets` (bones, 3) and `rests` (bones, 4) place each bone in
    its parent's rest frame. `limbs` are (bones, frames keyed in any case), parents first: their bones share keys.
    `tolerances` (bones, 2): how far the bone's head in space and its own rotation may be from the motion, infinite
    where it does not count. `planted` (frames, bones): which bones may not drift by more than `drift` to the next
    frame.

    `locations` (frames, 3) of the first bone and `rotations` (frames, bones, 4) are the motion, with signs that do not
    jump. Where `stays` (frames, bones), the curves stay from a frame to the next as `played_locations`
    (2 * frames - 1, 3) and `played_rotations` say at every half frame, all three or none.

    Raises InputError where the arrays are not those of one motion.
    """

def plain_ik(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    manipulation: ManipulationCue,
    floor: float = 0.0,
    settings: Settings | None = None,
) -> Job[EditedMotion]:
    """A hand along its cue by inverse kinematics of arm and spine, frame by frame: what the paper compares its editor
    with (section 4.3). The motion is lengthened as `edit_motion` does it. Out of reach it falls short.
    """

def motion_figures(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    first: int,
    end: int,
    floor: float = 0.0,
    manifold: Manifold | None = None,
) -> MotionFigures:
    """How frames `first` to `end` run: how smoothly, how near the manifold, how the feet stand, what an eye sees first.

    Frames in the answer count from `first`.
    """

def measure_motion(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    task: Task,
    complete: int,
    action_from: int | None = None,
    scene: SceneIndex | None = None,
    settings: Settings | None = None,
    moving: Sequence[MovingObject] = ...,
    wait: int = 0,
    library: Library | None = None,
) -> Job[Measured]:
    """What a report tells of any motion for the task: how it meets its cue at the frame `complete`, how the feet stand,
    and what an eye sees.

    `action_from`: the frame from which on the person sits down, after which the seat is no obstacle. `scene`: what
    stays where it is. `moving`: what does not, which `penetration` counts where it stands `wait` frames after each.
    `library`: what it is made of, beside whose poses its own are held.
    InputError for arrays of another shape, malformed tasks and unknown settings at once.
    """

def measure_performance(
    root_positions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    contacts: NDArray[np.float32],
    performance: Performance,
    moments: Sequence[Moments],
    scene: SceneIndex | None = None,
    settings: Settings | None = None,
    moving: Sequence[MovingObject] = ...,
    wait: int = 0,
    library: Library | None = None,
) -> Job[Measured]:
    """The same of any motion for a performance. `moments`: of each step that was played, in frames of the motion."""

def default_settings(preset: str = "default") -> Settings:
    """The settings of a preset, as `synthesize` takes them. InputError for an unknown name."""

def presets() -> list[str]:
    """Names of the presets."""

def cue_types() -> list[str]:
    """The action types that a cue may ask for, as `ActionCue` names them."""

def skeleton() -> Skeleton: ...
def map_rig(
    names: Sequence[str],
    parents: Sequence[int],
    heads: Sequence[Point],
    tails: Sequence[Point],
    mapping: Mapping[str, str] = ...,
) -> RigMapping:
    """Which bones of a rig are which joints of the unified skeleton, seen at rest: by names, else by shape.

    `parents`: each bone's parent by its place in the list, before it; -1 for none. `heads`, `tails`: where each begins
    and ends, metres, +Z up. `mapping` (ours -> theirs) goes before what is found. InputError with the rest of a
    sentence that begins with the rig's name, where no person is made so or a needed joint is not found.
    """
