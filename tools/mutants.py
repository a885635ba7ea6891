"""How many breaks of the core its unit tests notice: a seeded sample of cargo-mutants' mutants, and breaks by name.

Run by `nox -s mutants`. The mutants are made in a copy of the repository under `.nox/mutants`, with a target folder of
its own, so that one may go on working meanwhile. The summary goes to docs/mutants.md; what is said there of a missed
mutant, after its dash, is kept from run to run.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / ".nox" / "mutants"
TREE = FOLDER / "tree"
REPORT = ROOT / "docs" / "mutants.md"
SOURCE = "rust/oncue/src"
#: What is mutated, and the unit tests that are asked for it: its own, and those of what is made of it.
GROUPS = {
    "controller/*.rs": ["controller::", "synthesize::"],
    "synthesizer/*.rs": ["synthesizer::", "controller::"],
    "editor/*.rs": ["editor::", "synthesize::"],
    "metrics.rs": ["metrics::", "controller::", "synthesize::"],
    "synthesize.rs": ["synthesize::"],
    "scene/check.rs": ["scene::", "synthesize::"],
}
#: Tests that take as long as all others and show what their neighbours show too.
SKIPPED = ["learns_a_bandit", "the_field_never_promises_too_much", "chunks_and_cut_triangles", "odd_but_usable"]
PROFILE = "quick"
#: A mutant that loops for ever is given up after so many seconds.
TIMEOUT = 240
BREAKS_HEADING = "Breaks by name:"
#: What is said of a missed mutant that nobody has said anything of.
UNSAID = "not looked at yet"


class Break(NamedTuple):
    """One break made by hand: in `file`, `old` becomes `new`."""

    name: str
    file: str
    old: str
    new: str


#: What a user would notice first; each stands for a kind that some test must notice.
BREAKS = [
    Break(
        "No episode ends by a collision",
        "controller/episode.rs",
        "return Some(EpisodeEnd::Collision);",
        "",
    ),
    Break("No episode stalls", "controller/episode.rs", "return Some(EpisodeEnd::Stall);", ""),
    Break("No episode leaves the scene", "controller/episode.rs", "return Some(EpisodeEnd::LeftScene);", ""),
    Break(
        "The posture offset does not fade",
        "controller/episode.rs",
        "(a as f32 / OFFSET_FADE - 1.0).clamp(0.0, 1.0)",
        "{ let _ = a; 1.0 }",
    ),
    Break(
        "Every complete action has met its cue",
        "controller/episode.rs",
        "end == EpisodeEnd::Complete && is_met(tally.residual, tally.facing)",
        "{ let _ = tally; end == EpisodeEnd::Complete }",
    ),
    Break(
        "The view of the scene is inverted",
        "controller/state.rs",
        "1.0 - (clearance / 0.5).clamp(0.0, 1.0)",
        "(clearance / 0.5).clamp(0.0, 1.0)",
    ),
    Break("The view is mirrored", "controller/state.rs", "column as f32 - middle", "middle - column as f32"),
    Break(
        "A sit is open however far its end misses the cue",
        "controller/state.rs",
        "matched.position <= settings.refuse_position",
        "matched.position.is_finite()",
    ),
    Break("The worst motion is kept", "controller/kept.rs", "a.cost.total_cmp(&b.cost)", "b.cost.total_cmp(&a.cost)"),
    Break(
        "A missed cue costs nothing",
        "controller/kept.rs",
        "let missed = if met { 0.0 } else { w.missed };",
        "let _ = met; let missed = 0.0;",
    ),
    Break("The residual costs nothing", "controller/kept.rs", "+ w.residual * tally.residual", ""),
    Break("Penetration costs nothing", "controller/kept.rs", "+ w.penetrating * tally.penetrating as f32", ""),
    Break("Penetration is always 0 %", "metrics.rs", "100.0 * n as f32 / motion.len().max(1) as f32", "0.0 * n as f32"),
    Break("Every cue counts as met", "metrics.rs", "met: is_met(pelvis, facing)", "met: true"),
    Break(
        "The prior is never played",
        "synthesize.rs",
        "Some((StoredPolicy::prior()?, PolicySource::Prior))",
        "None",
    ),
    Break(
        "What is there is never played",
        "synthesize.rs",
        "if environment.is_clean(kept.end, &kept.tally) {",
        "if false {",
    ),
    Break(
        "The worse of the motions before and after is kept",
        "synthesize.rs",
        "before.cost < kept.cost",
        "before.cost > kept.cost",
    ),
    Break("No task is checked", "synthesize.rs", "check_task(scene, task)?;", ""),
    Break("Every way is clear", "scene/check.rs", "check_way(scene, task)\n}", "let _ = check_way; Ok(())\n}"),
    Break(
        "Every start has room",
        "scene/check.rs",
        "if room < START_ROOM {",
        "if room < 0.0 * START_ROOM {",
    ),
    Break("Whatever is asked is within reach", "editor/edit.rs", "const NEAR: f32 = 0.01;", "const NEAR: f32 = 1e9;"),
    Break("Planted feet are not held", "synthesizer/feet.rs", "(frame.contact[side] >= 1.0).then(", "false.then("),
    Break(
        "No sit is led to its cue",
        "synthesizer/mod.rs",
        "alignment.step(database, self.frame, &mut self.planar, self.floor);",
        "let _ = alignment;",
    ),
    Break("No joint is too fast", "synthesizer/mod.rs", "self.slow_down(&last, database);", "let _ = last;"),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tool", required=True, type=Path, help="cargo-mutants")
    parser.add_argument("--sample", type=int, default=60, help="how many mutants are drawn")
    parser.add_argument("--seed", type=int, default=1, help="which ones")
    parser.add_argument("--shard", default="0/1", help="of those drawn every n-th from the k-th on, k/n")
    parser.add_argument("--no-breaks", action="store_true", help="leave out the breaks by name")
    parser.add_argument("--no-report", action="store_true", help="leave docs/mutants.md as it is")
    arguments = parser.parse_args()
    arguments.tool = arguments.tool.resolve()
    first, step = map(int, arguments.shard.split("/"))
    copy_tree()
    every = list_mutants(arguments.tool)
    drawn = random.Random(arguments.seed).sample(every, min(arguments.sample, len(every)))[first::step]
    outcomes: dict[str, list[str]] = {"CaughtMutant": [], "MissedMutant": [], "Unviable": [], "Timeout": []}
    breaks: dict[str, bool] = {}
    try:
        for made in [] if arguments.no_breaks else BREAKS:
            breaks[made.name] = run_break(made)
        run_mutants(arguments.tool, drawn, outcomes)
    except KeyboardInterrupt:
        print("Stopped; what was tested until now is reported.")
    text = summary(len(every), len(drawn), arguments, outcomes, breaks)
    print(text)
    if not arguments.no_report:
        REPORT.write_text(text)


def copy_tree() -> None:
    """The repository's files in `TREE`; what has not changed keeps its time, so that little is compiled."""
    # A compiler that was stopped in a run before leaves parts there that link no more.
    shutil.rmtree(FOLDER / "target" / PROFILE / "incremental", ignore_errors=True)
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z", "Cargo.toml", "Cargo.lock", "rust"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, check=True, text=True).stdout.split("\0")
    wanted = {name for name in names if name and (ROOT / name).is_file()}
    for old in [path for path in TREE.rglob("*") if path.is_file()]:
        if old.relative_to(TREE).as_posix() not in wanted:
            old.unlink()
    for name in wanted:
        source, copy = ROOT / name, TREE / name
        if not (copy.is_file() and copy.read_bytes() == source.read_bytes()):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)


def environment() -> dict[str, str]:
    return os.environ | {"CARGO_TARGET_DIR": str(FOLDER / "target"), "CARGO_TERM_COLOR": "never"}


def list_mutants(tool: Path) -> list[dict[str, Any]]:
    """All mutants of what is mutated, in cargo-mutants' order."""
    command = [str(tool), "mutants", "--no-config", "--dir", str(TREE), "--package", "oncue", "--list", "--json"]
    for file in GROUPS:
        command += ["--file", f"{SOURCE}/{file}"]
    listed = subprocess.run(command, cwd=TREE, env=environment(), capture_output=True, text=True, check=False)
    if listed.returncode:
        sys.exit(listed.stderr)
    mutants: list[dict[str, Any]] = json.loads(listed.stdout)
    return mutants


def run_mutants(tool: Path, drawn: list[dict[str, Any]], outcomes: dict[str, list[str]]) -> None:
    """Adds the names of the drawn mutants to `outcomes`, by what became of them."""
    for files, tests in GROUPS.items():
        if of_group := [mutant for mutant in drawn if Path(mutant["file"]).match(f"{SOURCE}/{files}")]:
            run_group(tool, files, tests, of_group, outcomes)
    tested = sum(map(len, outcomes.values()))
    if tested != len(drawn):
        sys.exit(f"{tested} mutants were tested, {len(drawn)} were drawn.")


def run_group(
    tool: Path, files: str, tests: list[str], drawn: list[dict[str, Any]], outcomes: dict[str, list[str]]
) -> None:
    """Adds what became of the mutants of one group to `outcomes`."""
    command = [str(tool), "mutants", "--no-config", "--dir", str(TREE), "--in-place", "--package", "oncue"]
    # `--lib` for what is compiled, too.
    command += ["--profile", PROFILE, "--cargo-arg=--lib", "--timeout", str(TIMEOUT), "--output", str(FOLDER)]
    command += ["--file", f"{SOURCE}/{files}"]
    for mutant in drawn:
        command += ["--re", f"^{re.escape(mutant['name'])}$"]
    # Deleted fields are made whatever `--re` says, but not where nothing changed.
    diff = FOLDER / "drawn.diff"
    diff.write_text(diff_of_lines(drawn))
    command += ["--in-diff", str(diff)]
    try:
        subprocess.run([*command, "--", *test_arguments(tests)], cwd=TREE, env=environment(), check=False)
    finally:
        read_outcomes(outcomes, {mutant["name"] for mutant in drawn})


def read_outcomes(outcomes: dict[str, list[str]], drawn: set[str]) -> None:
    """Adds what cargo-mutants says of the drawn mutants in its last run."""
    for outcome in json.loads((FOLDER / "mutants.out" / "outcomes.json").read_text())["outcomes"]:
        if outcome["scenario"] == "Baseline":
            if outcome["summary"] != "Success":
                sys.exit("The tests fail without any mutant; see .nox/mutants/mutants.out/log.")
        elif (name := outcome["scenario"]["Mutant"]["name"]) in drawn:
            # A deleted field on a line that was drawn is made, but was not drawn itself.
            outcomes[outcome["summary"]].append(name)


def diff_of_lines(drawn: list[dict[str, Any]]) -> str:
    """A diff that adds the lines on which the drawn mutants begin."""
    out = []
    for file in sorted({mutant["file"] for mutant in drawn}):
        out += [f"--- a/{file}", f"+++ b/{file}"]
        text = (TREE / file).read_text().splitlines()
        lines = sorted({mutant["span"]["start"]["line"] for mutant in drawn if mutant["file"] == file})
        for added, line in enumerate(lines):
            out += [f"@@ -{line - 1 - added},0 +{line},1 @@", f"+{text[line - 1]}"]
    return "\n".join(out) + "\n"


def test_arguments(tests: list[str]) -> list[str]:
    skips = [argument for name in SKIPPED for argument in ("--skip", name)]
    return ["--", *tests, *skips]


def run_break(made: Break) -> bool:
    """Whether the tests notice a break."""
    path = TREE / SOURCE / made.file
    sound = path.read_text()
    # The code alone: what a module's own tests say of it stays.
    code, marker, own_tests = sound.partition("#[cfg(test)]\nmod tests {")
    if made.old not in code:
        sys.exit(f"‘{made.name}’: {made.file} does not say “{made.old}” any more.")
    command = ["cargo", "test", "--locked", "--package", "oncue", "--profile", PROFILE]
    tests = next(tests for files, tests in GROUPS.items() if Path(made.file).match(files))
    try:
        path.write_text(code.replace(made.old, made.new) + marker + own_tests)
        build = [*command, "--lib", "--no-run"]
        if subprocess.run(build, cwd=TREE, env=environment(), capture_output=True, check=False).returncode:
            sys.exit(f"‘{made.name}’ does not compile.")
        begun = time.monotonic()
        try:
            tested = subprocess.run(
                [*command, "--lib", *test_arguments(tests)],
                cwd=TREE,
                env=environment(),
                capture_output=True,
                timeout=TIMEOUT,
                check=False,
            )
            caught = tested.returncode != 0
        except subprocess.TimeoutExpired:
            caught = True
        print(f"{'caught' if caught else 'MISSED'} in {time.monotonic() - begun:.0f} s: {made.name}", flush=True)
        return caught
    finally:
        path.write_text(sound)


def summary(
    total: int, drawn: int, arguments: argparse.Namespace, outcomes: dict[str, list[str]], breaks: dict[str, bool]
) -> str:
    """docs/mutants.md."""
    counts = {kind: len(names) for kind, names in outcomes.items()}
    caught = counts["CaughtMutant"] + counts["Timeout"]
    viable = caught + counts["MissedMutant"]
    reasons = said_before()
    lines = [
        "# What the unit tests notice",
        "",
        "Written by `nox -s mutants` (tools/mutants.py), which breaks the core one place at a time, in a copy, and",
        "runs the unit tests of the broken module and of what is made of it. Integration tests and the add-on's would",
        "notice more; they are too slow to be asked each time.",
        "",
        f"Of {total} mutants that cargo-mutants makes of {', '.join(f'`{files}`' for files in GROUPS)}, "
        f"{arguments.sample} were drawn with seed {arguments.seed}, and {viable + counts['Unviable']} of them tested"
        + (f" (shard {arguments.shard}, of {drawn})" if arguments.shard != "0/1" else "")
        + ":",
        "",
        "| caught | of these by a test that never ends | missed | do not compile | share of those that compile |",
        "|---|---|---|---|---|",
        f"| {caught} | {counts['Timeout']} | {counts['MissedMutant']} | {counts['Unviable']} "
        f"| {100 * caught / max(viable, 1):.0f} % |",
        "",
        "Missed, and why each is let be:",
        "",
    ]
    for name in sorted(map(without_place, outcomes["MissedMutant"])):
        lines.append(f"- `{name}` – {reasons.get(name, UNSAID)}")
    if not outcomes["MissedMutant"]:
        lines.append("None.")
    if breaks:
        lines += ["", BREAKS_HEADING, "", "| break | |", "|---|---|"]
        lines += [f"| {name} | {'caught' if noticed else '**missed**'} |" for name, noticed in breaks.items()]
    elif REPORT.is_file():
        # Those of the last run that tried them.
        lines += ["", *REPORT.read_text().partition(BREAKS_HEADING)[1:]]
        lines[-2:] = "".join(lines[-2:]).rstrip().split("\n")
    return "\n".join(lines) + "\n"


def without_place(name: str) -> str:
    """A mutant's name without line and column, which change with every edit above it."""
    file, _, rest = name.partition(":")
    return f"{file.removeprefix(SOURCE + '/')}: {rest.partition(': ')[2]}"


def said_before() -> dict[str, str]:
    """What docs/mutants.md says of each mutant."""
    said = {}
    if REPORT.is_file():
        for line in REPORT.read_text().splitlines():
            if found := re.fullmatch(r"- `(.+)` – (.+)", line):
                said[found[1]] = found[2]
    return said


if __name__ == "__main__":
    main()
