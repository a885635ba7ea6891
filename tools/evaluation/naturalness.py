"""Can a classifier tell synthesized motion from the clips of a library, on one skeleton?

1 where it always can, 0.5 where it cannot: the area under the ROC curve of a random forest on windows that it was not
trained on. Beside it what the same forest finds where there is nothing to find: labels dealt out anew among the clips,
and two halves of the library's own clips.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import StratifiedKFold

from . import windows

if TYPE_CHECKING:
    from .experiments import Bench

Row = dict[str, Any]
Floats = windows.Floats

TREES, LEAF, FOLDS = 200, 2, 5
#: How often the labels are dealt out anew, and the library is halved.
DRAWS = 2
#: Less than this is no motion: cm or cm/s.
STILL = 0.01
#: How many features are named.
TELLING = 10
#: What a library calls those of its clips' stretches in which one walks.
ON_FOOT = ("walk", "stop")


class Windows(NamedTuple):
    """The windows of some clips: `features` (windows, features), and for each window the number of its `clip`."""

    features: Floats
    clip: np.ndarray

    @classmethod
    def of(cls, clips: list[list[Floats]], width: int) -> Windows:
        """Of the windows of each clip; clips without any are left out."""
        clips = [clip for clip in clips if len(clip)]
        features = np.array([window for clip in clips for window in clip]).reshape(-1, width)
        return cls(features, np.repeat(np.arange(len(clips)), [len(clip) for clip in clips]))

    @property
    def clips(self) -> int:
        return len(np.unique(self.clip))

    def only(self, clips: np.ndarray) -> Windows:
        kept = np.isin(self.clip, clips)
        return Windows(self.features[kept], self.clip[kept])


def moving(*sets: Windows) -> np.ndarray:
    """The features that move in all of the sets, by more than STILL in half of the windows.

    A bone that a library never bends is how its captures were read, and would tell all by itself.
    """
    return np.flatnonzero(np.all([np.median(one.features, axis=0) > STILL for one in sets], axis=0))


def out_of_fold(features: Floats, labels: np.ndarray, clip: np.ndarray, seed: int) -> tuple[float, Floats]:
    """The area under the ROC curve over the windows of clips left out of training, and each feature's importance."""
    # A clip has one label; each fold has clips of both.
    clips, first = np.unique(clip, return_index=True)
    parts = min(FOLDS, *np.bincount(labels[first], minlength=2))
    told, importance = np.zeros(len(labels)), np.zeros(features.shape[1])
    for _, left_out in StratifiedKFold(parts, shuffle=True, random_state=seed).split(clips, labels[first]):
        test = np.isin(clip, clips[left_out])
        # Every core grows trees; which does not matter to what grows.
        forest = RandomForestClassifier(TREES, min_samples_leaf=LEAF, random_state=seed, n_jobs=-1)
        forest.fit(features[~test], labels[~test])
        told[test] = forest.predict_proba(features[test])[:, 1]
        importance += forest.feature_importances_ / parts
    return float(roc_auc_score(labels, told)), importance


def joined(one: Windows, other: Windows) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Features, labels (0 for `one`, 1 for `other`) and clips, which are numbered on."""
    after = one.clip.max() + 1
    labels = np.repeat([0, 1], [len(one.clip), len(other.clip)])
    return np.vstack([one.features, other.features]), labels, np.concatenate([one.clip, other.clip + after])


def told_apart(one: Windows, other: Windows, seed: int) -> tuple[float, Floats]:
    """As `out_of_fold`, of two sets of clips."""
    return out_of_fold(*joined(one, other), seed)


def shuffled(one: Windows, other: Windows, seed: int) -> float:
    """The area where the labels are dealt out anew among the clips: those of one clip stay alike."""
    features, labels, clip = joined(one, other)
    clips, first = np.unique(clip, return_index=True)
    dealt = np.random.default_rng(seed).permutation(labels[first])
    return out_of_fold(features, dealt[np.searchsorted(clips, clip)], clip, seed)[0]


def halves(one: Windows, seed: int) -> list[float]:
    """The areas between two halves of the clips, halved again and again; none of clips too few to be halved."""
    found = []
    one = one._replace(features=one.features[:, moving(one)])
    for draw in range(DRAWS if one.clips >= 4 else 0):
        clips = np.random.default_rng(seed + draw).permutation(np.unique(one.clip))
        middle = len(clips) // 2
        found.append(told_apart(one.only(clips[:middle]), one.only(clips[middle:]), seed + draw)[0])
    return found


def compared(one: Windows, other: Windows, names: list[str], seed: int) -> Row:
    """How well two sets are told apart, and with shuffled labels, and what tells most with both medians."""
    kept = moving(one, other)
    one, other = (each._replace(features=each.features[:, kept]) for each in (one, other))
    names = [names[k] for k in kept]
    area, importance = told_apart(one, other, seed)
    telling = np.argsort(-importance, kind="stable")[:TELLING]
    medians = np.median(one.features, axis=0), np.median(other.features, axis=0)
    return {
        "auc": area,
        "shuffled": [shuffled(one, other, seed + draw) for draw in range(DRAWS)],
        "telling": [(names[k], float(medians[0][k]), float(medians[1][k])) for k in telling],
    }


# --- the motions ----------------------------------------------------------------------------------


def library_windows(body: windows.Body, library, source: str) -> dict[str, Windows]:
    """Walks and sits of a library's clips from `source` ("mocap" or "procedural"), mirrored copies left out."""
    walks, sits = [], []
    for number in range(library.clip_count):
        clip = library.clip(number)
        if clip["mirrored"] or clip["source"] != source:
            continue
        motion = clip["root_positions"], clip["rotations"]
        walks.append(body.walks(*motion, on_foot(clip["segments"])))
        sits.append(body.sits(*motion, [part["complete"] for part in clip["segments"] if part["label"] == "sit"]))
    width = len(body.names)
    return {"walks": Windows.of(walks, width), "sits": Windows.of(sits, width)}


def on_foot(segments: list[Row]) -> list[tuple[int, int]]:
    """The spans of a clip in which one walks: segments of walking that follow on each other are one."""
    spans: list[tuple[int, int]] = []
    for part in segments:
        if part["label"] not in ON_FOOT:
            continue
        if spans and spans[-1][1] == part["first"]:
            spans[-1] = spans[-1][0], part["end"]
        else:
            spans.append((part["first"], part["end"]))
    return spans


@functools.cache
def _source() -> str:
    """Of what makes windows: what was measured otherwise is measured anew."""
    return hashlib.sha256(Path(windows.__file__).read_bytes()).hexdigest()[:20]


def synthesized_windows(bench: Bench, body: windows.Body, library: str) -> dict[str, Windows]:
    """Walks and sits of the motions for the tasks of the rooms, as an artist gets them: edited."""
    import oncue_core

    walks, sits = [], []
    for name in bench.rooms.names[: 2 if bench.quick else None]:
        if bench.only_rooms and name not in bench.only_rooms:
            continue
        scene = bench.rooms.scene(name)
        for number, task in enumerate(scene.tasks[: 2 if bench.quick else bench.most_tasks], 1):

            def make(scene=scene, task=task) -> Row:
                try:
                    motion = oncue_core.synthesize(scene.index, bench.libraries[library], task, {}, bench.seed).result()
                except oncue_core.InputError as error:
                    return {"problem": str(error), "walks": [], "sits": []}
                arrays, floor = (motion.root_positions, motion.rotations), scene.index.floor_height
                edited = motion.report["edited"]
                seated = [edited["complete_frame"]] if edited and edited["seat"] else []
                walked = body.walks(*arrays, [(0, len(arrays[0]))], floor)
                return {"walks": np.array(walked).tolist(), "sits": np.array(body.sits(*arrays, seated)).tolist()}

            key = bench.key("naturalness", library, scene=scene.index.fingerprint, task=task, windows=_source())
            row = bench.store.get(key, make)
            walks.append(row["walks"])
            sits.append(row["sits"])
            bench.say(f"{library}, {name}, task {number}: {len(row['walks'])} windows of walking")
    width = len(body.names)
    return {"walks": Windows.of(walks, width), "sits": Windows.of(sits, width)}


class Comparison(NamedTuple):
    """A set of motions to be told from clips of a library."""

    what: str
    #: The library that the motions are made with.
    library: str
    #: The library and the source of its clips, and what they are called.
    clips: tuple[str, str]
    called: str


def comparisons(libraries: dict[str, Any]) -> Iterator[Comparison]:
    """Each library's motions beside what it holds, and the starter's beside captures where there are any."""
    for what in ("walks", "sits"):
        for name in libraries:
            for clips in libraries:
                source = "procedural" if clips == "starter" else "mocap"
                called = "the starter's own, made by rule" if clips == "starter" else f"captured, {clips}"
                # A library of captures has the starter's clips of what was not captured.
                if clips in (name, next(iter(libraries))) or what == "sits":
                    yield Comparison(what, name, (clips, source), called)


def naturalness(bench: Bench) -> Iterator[Row]:
    """Walks and sits of each library's motions against clips: one row a comparison."""
    import oncue_core

    body = windows.Body(oncue_core.skeleton())
    made = {name: synthesized_windows(bench, body, name) for name in bench.libraries}
    held: Callable[[str, str], dict[str, Windows]] = functools.cache(
        lambda name, source: library_windows(body, bench.libraries[name], source)
    )
    halved = functools.cache(lambda clips, what: halves(held(*clips)[what], bench.seed))
    for comparison in comparisons(bench.libraries):
        one, other = held(*comparison.clips)[comparison.what], made[comparison.library][comparison.what]
        row: Row = {
            "what": comparison.what,
            "library": comparison.library,
            "clips": comparison.called,
            "held": (one.clips, len(one.clip)),
            "made": (other.clips, len(other.clip)),
        }
        # Two folds are the least that leave something out.
        if one.clips >= 2 and other.clips >= 2:
            row |= compared(one, other, body.names, bench.seed)
            row["halves"] = halved(comparison.clips, comparison.what)
            bench.say(f"{comparison.what}, {comparison.library} against {comparison.called}: AUC {row['auc']:.2f}")
        yield row
