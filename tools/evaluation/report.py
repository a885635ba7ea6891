"""Tables in Markdown and plots, the paper's rows beside ours."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from . import eyes_table
from .pictures import OPENINGS, SEATS

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Row = dict[str, Any]

#: The paper's Table 1: contact in cm, penetration in percent of the frames.
PAPER_BASELINES = {"Wang et al.": (6.32, 2.75), "SAMP": (11.75, 7.18), "LAMA": (4.34, 1.30)}
#: Section 4.3.
PAPER_ABLATION = {"whole": 1.1, "without r_coli": 15.7}
#: Tables 2 and 3: percent of the starts.
PAPER_ROBUSTNESS = {"original": [10.5, 25.9, 25.5, 13.9], "generalized": [40.2, 81.7, 77.0, 71.7]}
PAPER_UNSEEN = [70.5, 53.4, 11.9, 21.2]
#: Supplementary: seconds from scratch and for inference alone.
PAPER_SECONDS = (379.0, 0.15)


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.2f}"
    return str(value)


def mean(rows: Iterable[Row], name: str) -> float:
    values = [row[name] for row in rows if row.get(name) is not None and not np.isnan(row[name])]
    return statistics.fmean(values) if values else float("nan")


def reachable(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if not row.get("unreachable")]


def by(rows: Iterable[Row], name: str) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[name], []).append(row)
    return groups


def tasks_section(rows: list[Row], out: Path) -> str:
    summary, failures = [], []
    for library, group in by(rows, "library").items():
        played = reachable(group)
        met = [row for row in played if row["success"]]
        seconds = sorted(row["seconds"] for row in played)
        summary.append(
            (
                library,
                f"{len(met)} of {len(played)}",
                statistics.median(seconds),
                seconds[-1],
                statistics.median(row["updates"] for row in played),
                max(row["updates"] for row in played),
                max(row["environment_steps"] for row in played),
            )
        )
        failures += [(library, row["room"], row["cue"], row["problem"]) for row in group if not row["success"]]
    figure, axes = plt.subplots(figsize=(7, 3))
    for library, group in by(reachable(rows), "library").items():
        seconds = np.sort([row["seconds"] for row in group])
        axes.plot(seconds, np.arange(1, len(seconds) + 1), marker=".", label=library)
    axes.axvline(30, color="0.7", linestyle="--", label="half a minute")
    axes.set(xlabel="seconds to the finished motion", ylabel="tasks", xscale="log")
    axes.legend()
    _save(figure, out / "evaluation-tasks.png")
    header = ("library", "met", "median s", "worst s", "median updates", "most updates", "most environment steps")
    return "\n\n".join(
        [
            "## Every task of the rooms, in a scene never seen",
            "Seconds are those of the synthesis with the library in memory; indexing the scene adds 0.02 to 0.5 s. "
            "The paper optimizes each policy for 379 s on an RTX 3090.",
            table(header, summary),
            "![Seconds](pictures/evaluation-tasks.png)",
            "What was not met, and why:" if failures else "Every task was met.",
            table(("library", "room", "cue", "reason"), failures) if failures else "",
            _tasks_table(rows),
        ]
    )


def _tasks_table(rows: list[Row]) -> str:
    header = ("library", "room", "task", "s", "updates", "pelvis cm", "facing °", "contact cm", "skate cm", "pen. %")
    header += ("body %", "path ratio", "joint ratio", "acc. ratio")
    names = ("seconds", "updates", "pelvis_cm", "facing_degrees", "contact_cm", "skate_cm", "penetration")
    names += ("whole_body", "path_ratio", "joint_ratio", "acceleration_ratio")
    shown = [(row["library"], row["room"], row["task"], *(row[name] for name in names)) for row in reachable(rows)]
    return "<details><summary>Each task</summary>\n\n" + table(header, shown) + "\n\n</details>"


def sequences_section(rows: list[Row], libraries: dict[str, Any], out: Path) -> str:
    lines = [(f"*{name}* (paper)", "", contact, "", pen, *[""] * 6) for name, (contact, pen) in PAPER_BASELINES.items()]
    bars = dict(PAPER_BASELINES)
    for library, group in by(rows, "library").items():
        played = reachable(group)
        met = sum(row["success"] for row in played)
        figures = [mean(played, name) for name in ("contact_cm", "skate_cm", "penetration", "whole_body")]
        figures += [mean(played, "path_ratio"), max(row["joint_ratio"] for row in played)]
        figures.append(mean(played, "faster_turns"))
        harder = [row["acceleration_ratio"] for row in played]
        acceleration = f"{mean(played, 'harder_percent'):.2f} ({statistics.median(harder):.1f}, {max(harder):.1f})"
        own = libraries[library].foot_figures()
        share = f"{met} of {len(played)} ({100 * met / max(len(played), 1):.0f} %)"
        figures += [acceleration, f"{own['skate_cm']:.2f} / {own['contact_cm']:.2f}"]
        lines.append((f"Oncue, {library}", share, *figures))
        bars[f"Oncue, {library}"] = (figures[0], figures[2])
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
    for axes, column, label in ((left, 0, "contact, cm"), (right, 1, "penetration, % of frames")):
        colours = ["0.7" if name in PAPER_BASELINES else "tab:blue" for name in bars]
        axes.barh(list(bars), [value[column] for value in bars.values()], color=colours)
        axes.set_xlabel(label)
        axes.invert_yaxis()
    _save(figure, out / "evaluation-sequences.png")
    header = ("method", "met", "contact cm", "skate cm/frame", "penetration %", "whole body %", "path / shortest")
    header += ("fastest joint / library's 99.9 %", "turns faster than that % (library 0.1)")
    header += ("accelerations over the library's 99.9 %, % (largest ratio: median, worst)",)
    header += ("the library's own skate / contact",)
    failures = [(r["library"], r["room"], r["cue"], r["problem"]) for r in rows if not r["success"]]
    return "\n\n".join(
        [
            "## Random starts (the paper's Table 1)",
            "Measured after the controller, before any editing.",
            table(header, lines),
            "![Contact and penetration](pictures/evaluation-sequences.png)",
            table(("library", "room", "cue", "reason"), failures) if failures else "Every sequence met its cue.",
        ]
    )


def ablations_section(rows: list[Row], out: Path) -> str:
    lines, bars = [], {}
    for variant, group in by(rows, "variant").items():
        played = reachable(group)
        met = f"{sum(row['success'] for row in played)} of {len(played)}"
        names = ("penetration", "whole_body", "contact_cm", "skate_cm")
        bars[variant] = mean(played, "penetration")
        paper = PAPER_ABLATION.get(variant, "")
        lines.append((variant, met, *(mean(played, n) for n in names), max(r["joint_ratio"] for r in played), paper))
    figure, axes = plt.subplots(figsize=(7, 2.6), layout="constrained")
    places = np.arange(len(bars))
    axes.barh(places - 0.2, list(bars.values()), 0.4, label="Oncue")
    axes.barh(places + 0.2, [PAPER_ABLATION.get(name, 0.0) for name in bars], 0.4, color="0.7", label="paper")
    axes.set_yticks(places, list(bars))
    axes.set_xlabel("penetration, % of frames")
    axes.invert_yaxis()
    axes.legend()
    _save(figure, out / "evaluation-ablations.png")
    header = (
        "variant",
        "met",
        "penetration %",
        "whole body %",
        "contact cm",
        "skate cm",
        "fastest joint",
        "paper's pen. %",
    )
    return "\n\n".join(
        [
            "## Ablations (section 4.3)",
            "Each policy from scratch; its mean alone is played, without a choice among rollouts.",
            table(header, lines),
            "![Ablations](pictures/evaluation-ablations.png)",
        ]
    )


def robustness_section(rows: list[Row], out: Path) -> str:
    lines = [(f"*{name}* (paper)", "", *(f"{v:.1f}" for v in values)) for name, values in PAPER_ROBUSTNESS.items()]
    home = [row for row in rows if row["policy"] != "unseen scene"]
    for policy, group in by(home, "policy").items():
        ratios = [f"{100 * row['ratio']:.1f}" for row in group]
        lines.append((policy, group[0]["room"], *ratios, *[""] * (4 - len(ratios))))
    unseen = [("*LAMA* (paper)", "W1, W1, W2, W2", ", ".join(f"{v:.1f}" for v in PAPER_UNSEEN))]
    for room, group in by([row for row in rows if row["policy"] == "unseen scene"], "room").items():
        unseen.append(("prior", room, ", ".join(f"{100 * row['ratio']:.1f}" for row in group)))
    _starts_picture(home, out / "evaluation-robustness.png")
    return "\n\n".join(
        [
            "## Robustness (section 4.4, Tables 2 and 3)",
            "Percent of all valid starts on a grid over the floor from which the policy alone, without optimization, "
            "meets the cue: 5 trials each facing anywhere, 2 needed. *original* was optimized for one start and the "
            "first cue, *generalized* from the prior with random starts and the cues shown; *prior* is what ships, and "
            "has seen none of these rooms.",
            table(("policy", "room", "cue 1", "cue 2", "cue 3", "cue 4"), lines),
            "![Starts](pictures/evaluation-robustness.png)",
            "Unseen scenes:",
            table(("policy", "room", "percent of starts, cue by cue"), unseen),
        ]
    )


def _starts_picture(rows: list[Row], path: Path) -> None:
    """As the paper's figure 10: the starts that a policy serves."""
    groups = by(rows, "policy")
    width = max(len(group) for group in groups.values())
    figure, grid = plt.subplots(
        len(groups), width, figsize=(3 * width, 2.6 * len(groups)), layout="constrained", squeeze=False
    )
    for line, (policy, group) in zip(grid, groups.items(), strict=True):
        for axes, row in zip(line, group, strict=False):
            places = np.array([start["place"] for start in row["starts"]])
            met = np.array([start["met"] for start in row["starts"]])
            axes.scatter(*places.T, c=met, cmap="viridis", vmin=0, vmax=5, s=14)
            axes.plot(*row["cue"]["position"][:2], marker="s", color="red", markersize=7)
            axes.set_title(f"{policy}, cue {row['task']}: {100 * row['ratio']:.0f} %", fontsize=9)
            axes.set_aspect("equal")
            axes.tick_params(labelsize=6)
    _save(figure, path)


def time_section(rows: list[Row]) -> str:
    lines = [("*paper* (RTX 3090)", "", PAPER_SECONDS[0], "", "", PAPER_SECONDS[1], "")]
    lines += [
        (row["room"], row["task"], row["scratch_s"], row["scratch_updates"], row["prior_s"], row["inference_s"],
         "yes" if row["inference_success"] else "no")
        for row in rows
    ]  # fmt: skip
    header = ("room", "task", "from scratch s", "updates", "from the prior, best of 512 s", "inference only s", "met")
    return "\n\n".join(["## Computation time", table(header, lines)])


def editing_section(seats: list[Row], openings: list[Row], out: Path) -> str:
    """Residuals of the editor, its ablation and its pictures."""
    parts = [
        "## Editing (section 4.3, figure 9)",
        "After the controller's motion; mean / max, over the frames that an edit may change. *Acceleration* is the "
        "largest of any joint, *jerk* the mean; *manifold* is the mean distance of the joints from those of Ψ⁻¹(Ψ(X)); "
        "*slide* the largest step of a planted foot between two frames. The paper shows pictures of its ablation and "
        "gives no figures; the three motions that come with its code end 0.1 to 10.8 cm from the hips' cue and 20 to "
        "40 cm from the feet's.",
    ]
    if openings:
        parts += _openings_parts(openings, out)
    return "\n\n".join([*parts, *_seats_parts(seats, out)])


def _spread(rows: Iterable[Row], name: str) -> str:
    values = [row[name] for row in rows if row.get(name) is not None]
    return f"{statistics.fmean(values):.2f} / {max(values):.2f}" if values else "–"


def _openings_parts(rows: list[Row], out: Path) -> list[str]:
    solved = [row for row in rows if not row["problem"]]
    names = ("mean_cm", "max_cm", "manifold_cm", "acceleration", "jerk", "worst_skate_cm", "seconds")
    lines = []
    for method, group in by(solved, "method").items():
        within = sum(row["max_cm"] <= 1.0 for row in group)
        of = sum(row["method"] == method for row in rows)
        lines.append((method, f"{within} of {of}", *(_spread(group, name) for name in names)))
    header = ("method", "within 1 cm", "hand's mean cm", "hand's max cm", "manifold cm", "acceleration m/s²")
    header += ("jerk m/s³", "slide cm", "s")
    each = [(row["part"], row["method"], *(row[name] for name in names)) for row in solved]
    refused = [(row["part"], row["method"], row["problem"]) for row in rows if row["problem"]]
    parts = [
        "### What a hand opens",
        "Parts of real objects, each opened by the right hand from where the controller stops or sits down: over their "
        "whole range, doors as far as who stands before them pulls (55 %). Three methods on the same motion: the "
        "editor; its finishing pass without the search along the manifold; and inverse kinematics of arm and spine, "
        "frame by frame, whose pelvis and legs stay as they are.",
        table(header, lines),
    ]
    if (out / OPENINGS).is_file():
        words = "Left of each pair: Oncue; right: plain inverse kinematics, at the same frame."
        parts += [f"![What a hand opens](pictures/{OPENINGS})", words]
    if refused:
        parts.append(table(("part", "method", "refused"), refused))
    details = table(("part", "method", *header[2:]), each)
    return [*parts, f"<details><summary>Each part</summary>\n\n{details}\n\n</details>"]


def _seats_parts(rows: list[Row], out: Path) -> list[str]:
    fitted = [row for row in rows if not row["problem"]]
    names = ("pelvis_before_cm", "pelvis_cm", "facing_degrees", "feet_cm", "thigh_cm", "back_cm")
    names += ("acceleration_before", "acceleration", "skate_before_cm", "skate_cm", "seconds")
    lines = []
    for wish, group in by(fitted, "wish").items():
        lines.append((wish, len(group), *(_spread(group, name) for name in names)))
    header = ("pelvis before cm", "pelvis cm", "facing °", "feet cm", "thigh in seat cm", "back in rest cm")
    header += ("acceleration before", "acceleration m/s²", "skate before cm", "skate cm", "s")
    heights = [row["seat_m"] for row in fitted]
    each = [(row["room"], row["task"], row["wish"], row["seat_m"], *(_value(row[n]) for n in names)) for row in fitted]
    refused = [(row["room"], row["task"], row["wish"], row["problem"]) for row in rows if row["problem"]]
    parts = ["### Seats"]
    if heights:
        parts.append(
            f"{len(fitted)} fits of the rooms' seats, {min(heights):.2f} to {max(heights):.2f} m high: as the cue is "
            "given; with a cue for each foot; and with the cue moved by 8 cm, raised by 4 cm and turned by 11°."
        )
    parts.append(table(("wish", "fits", *header), lines))
    if (out / SEATS).is_file():
        words = "Left of each pair: fitted to the cue as it is; right: to the cue moved by 8 cm and turned by 11°."
        parts += [f"![Seats](pictures/{SEATS})", words]
    if refused:
        parts.append(table(("room", "task", "wish", "not fitted"), refused))
    details = table(("room", "task", "wish", "seat m", *header), each)
    return [*parts, f"<details><summary>Each seat</summary>\n\n{details}\n\n</details>"]


def naturalness_section(rows: list[Row]) -> str:
    """How well motions are told from clips, and by what."""
    lines, parts = [], []
    for row in rows:
        title = f"{row['what']}, {row['library']}"
        held, made = (f"{clips}, {count}" for clips, count in (row["held"], row["made"]))
        if "auc" not in row:
            lines.append((title, row["clips"], held, made, "–", "–", "–"))
            continue
        nulls = (_around(row[name]) for name in ("shuffled", "halves"))
        lines.append((title, row["clips"], held, made, row["auc"], *nulls))
        header = ("feature", "clips", "motions")
        features = [(name, f"{one:.1f}", f"{other:.1f}") for name, one, other in row["telling"]]
        words = f"{title}, against {row['clips']}"
        parts.append(f"<details><summary>{words}</summary>\n\n{table(header, features)}\n\n</details>")
    header = ("motions", "clips", "clips, windows", "motions, windows", "AUC", "labels shuffled", "halves of the clips")
    return "\n\n".join(
        [
            "## Told apart?",
            "Clips as a library holds them on Oncue's skeleton, unmirrored, against the edited motions of the rooms' "
            "tasks: the area under the ROC curve of a classifier, 1 where it always tells which is which and 0.5 where "
            "it guesses. One-second windows every half second, low-passed (sd 1.5 frames), toes left out; of each "
            "joint the mean, largest and sd of its speed and its range forward, left and up in the pelvis's frame, "
            "never where it is, and no bone that one side never moves. "
            "A random forest of 200 trees, leaves of 2 or more, asked about windows of clips that "
            "it was not trained on, in five folds by clip. *Walks*: windows over 0.4 m/s with the pelvis upright, in "
            "clips within what is labelled as walking or stopping. *Sits*: from 2 s before the body is seated until "
            "1 s after. Beside it what the same forest makes of nothing, mean (least to most): labels dealt out anew "
            "among the clips, and two halves of the clips against each other. – where there are too few clips.",
            table(header, lines),
            "What tells them apart most, medians in cm/s and cm:",
            *parts,
        ]
    )


def eyes_section(rows: list[Row], clips: dict[str, Row]) -> str:
    """What an eye sees, before and now, beside people and clips."""
    made, seeds = [row for row in rows if not row["problem"]], len({row["seed"] for row in rows})
    refused = [
        (row["library"], row["room"], row["task"], row["seed"], row["problem"]) for row in rows if row["problem"]
    ]
    shown = [row for row in made if eyes_table.shows(row)]
    header = (
        "library",
        "room",
        "task",
        "seed",
        "own body cm",
        "elbow or knee °",
        "arms %",
        "scene %",
        "scene cm",
        "problems",
    )
    names = ("library", "room", "task", "seed", "own_cm", "hinge_degrees", "arms_percent", "scene_percent", "scene_cm")
    each = table(header, [(*(row[name] for name in names), " ".join(row["problems"])) for row in shown])
    return "\n\n".join(
        [
            "## What an eye sees",
            f"{len(made)} motions of the rooms' tasks, edited as an artist gets them, by {seeds} seeds; the rows are "
            "those of `body` and `style` in a report ([report.md](report.md)), medians over the motions where "
            "nothing else is said. *Clips* are measured by the same code, on the same skeleton, mirrored copies "
            "left out; ACCAD has no sits. *Before*: 35 motions with ACCAD's library before the figures saw any of "
            "it; *people*: ACCAD's walks and turns, in brackets thirty captured walk–sit–stands of another set; "
            "both measured by code that shares nothing with the project, so that small differences say nothing.",
            table(*eyes_table.lines(rows, clips)),
            table(("library", "room", "task", "seed", "no motion"), refused) if refused else "Every task has a motion.",
            f"<details><summary>The {len(shown)} motions in which something is seen</summary>\n\n{each}\n\n</details>",
        ]
    )


def variation_section(rows: list[Row]) -> str:
    """How seeds differ, per task."""
    lines = []
    for library, group in by(rows, "library").items():
        apart = [row["apart_cm"] for row in group if row["apart_cm"] is not None]
        near = f"{sum(value < 8 for value in apart)} of {len(apart)}"
        ends = (statistics.median(apart), min(apart)) if apart else ("–", "–")
        lines.append((library, len(group), near, *ends))
    header = ("library", "room", "task", "cue", "end poses", "nearest two cm", "durations apart s")
    names = ("library", "room", "task", "cue", "seeds", "apart_cm", "seconds_apart")
    each = table(header, [tuple(_value(row[name]) for name in names) for row in rows])
    return "\n\n".join(
        [
            "## Seeds as takes",
            "Each task by several seeds: the mean distance of the joints, in the world, between the two end poses "
            "that are nearest to each other. Asked for are 8 cm where the seat allows others; before, three seeds "
            "ended within 1.3 cm.",
            table(("library", "tasks", "under 8 cm", "median of the nearest cm", "least cm"), lines),
            f"<details><summary>Each task</summary>\n\n{each}\n\n</details>",
        ]
    )


def _around(values: Sequence[float]) -> str:
    return f"{statistics.fmean(values):.2f} ({min(values):.2f} to {max(values):.2f})" if values else "–"


def _value(value: float | None) -> float | str:
    return "–" if value is None else value


def _save(figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
