"""The repository's verbs, the same for people and for CI: `python3 -m nox -s VERB`.

They need Rust, Python 3.11 or newer and nox; everything else comes from the package indexes into `.nox/`.
Blender is the `bpy` module of the same version, which exists for Python 3.11 (4.2 to 5.0) and 3.13 (5.2).
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import nox

ROOT = Path(__file__).parent
ENVIRONMENTS = ROOT / ".nox"
OUT = ROOT / "out"
#: Wheels and extension archives of this machine; `dist/` has those for everybody.
LOCAL = OUT / "build"
DIST = ROOT / "dist"
#: The terms of what is compiled into the wheel; made with it.
NOTICES = ROOT / "LICENSES-THIRD-PARTY.txt"

MATURIN = ["maturin==1.16.0"]
ZIG = ["ziglang==0.17.1"]
CARGO_DENY = "0.20.2"
LINTERS = ["ruff==0.17.6", "mypy==2.4.1", "numpy==2.4.6", "pytest==9.2.0", "nox"]
#: Tells synthesized motion from captured; the product never sees it.
CLASSIFIER = ["scikit-learn==1.9.1", "scipy==1.17.1"]
EVALUATION = ["numpy==2.4.6", "trimesh==5.2.0", "matplotlib==3.11.2", *CLASSIFIER]
CORE_TESTS = ["pytest==9.2.0", "mypy==2.4.1", "numpy==2.4.6", *CLASSIFIER]
#: A crash or a hang in Blender's exit must not hold the run.
BLENDER_TESTS = ["pytest==9.2.0", "pytest-timeout==2.4.0"]
#: What breaks the core for `mutants`; not in CI.
CARGO_MUTANTS = "27.1.0"
#: What the benches run beside us; the product never sees it.
PEERS = ["torch==2.15.0", "numpy==2.4.6", "scipy==1.17.1", "embreex==4.4.0.post1"]


class Blender(NamedTuple):
    """A Blender as a Python module, and what it runs with."""

    version: str
    python: str
    requirements: tuple[str, ...] = ()

    @property
    def series(self) -> str:
        return ".".join(self.version.split(".")[:2])


#: Oldest first.
BLENDERS = (
    Blender("4.2.23", "3.11", ("numpy<2",)),
    Blender("4.5.15", "3.11"),
    Blender("5.0.1", "3.11"),
    Blender("5.2.3", "3.13"),
)

nox.options.sessions = ["test"]
nox.options.default_venv_backend = "none"
nox.options.stop_on_first_error = True


# --- what the verbs are made of -------------------------------------------------------------------


@functools.cache
def interpreter(version: str) -> str | None:
    """A Python of this minor version: the one that runs nox, on the PATH, or in a pyenv."""
    name = f"python{version}"
    candidates = [sys.executable, shutil.which(name)]
    roots = [Path(sys.base_prefix).parent, Path.home() / ".pyenv" / "versions"]
    if "PYENV_ROOT" in os.environ:
        roots.append(Path(os.environ["PYENV_ROOT"]) / "versions")
    for root in roots:
        candidates += map(str, sorted(root.glob(f"{version}*/bin/{name}"), reverse=True))
    for candidate in candidates:
        if candidate and _version_of(candidate) == version:
            return candidate
    return None


def _version_of(python: str) -> str | None:
    # A version manager's shim is there whether or not its Python is, so the Python itself is asked.
    command = [python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def blenders(session: nox.Session) -> list[Blender]:
    """The Blenders that this machine's Pythons allow, oldest first."""
    found = [blender for blender in BLENDERS if interpreter(blender.python)]
    if not found:
        wanted = " or ".join(sorted({blender.python for blender in BLENDERS}))
        session.error(f"Blender's Python module needs Python {wanted}, and neither was found. Please install one.")
    return found


def environment(session: nox.Session, name: str, requirements: list[str], python: str | None = None) -> Path:
    """The Python of the virtual environment `name` with exactly these requirements; made when they change."""
    python = python or sys.executable
    folder = ENVIRONMENTS / name
    stamp = folder / "requirements.txt"
    wanted = "\n".join([f"# {python}", *requirements])
    executable = folder / "bin" / "python"
    if not (stamp.is_file() and stamp.read_text() == wanted):
        # virtualenv comes with nox and needs no ensurepip, which Debian keeps in a package of its own.
        session.run(sys.executable, "-m", "virtualenv", "--quiet", "--clear", "--python", python, str(folder))
        if requirements:
            session.run(str(executable), "-m", "pip", "install", "--quiet", *requirements)
        stamp.write_text(wanted)
    return executable


def blender_environment(session: nox.Session, blender: Blender, wheel: Path | None = None) -> Path:
    """The Python of `blender`'s module; with `wheel`, oncue_core is installed in it."""
    requirements = [f"bpy=={blender.version}", *blender.requirements, *BLENDER_TESTS]
    python = environment(session, f"blender-{blender.version}", requirements, interpreter(blender.python))
    if wheel:
        install_wheel(session, python, wheel)
    return python


def install_wheel(session: nox.Session, python: Path, wheel: Path) -> None:
    """Installs oncue_core in the environment of `python`, in place of an earlier one."""
    session.run(str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--force-reinstall", str(wheel))


def build_wheel(session: nox.Session, *, portable: bool = False) -> Path:
    """The abi3 wheel of oncue_core.

    Linked by this machine's linker it shares its compiled parts with the Rust tests, and any Blender of this
    machine loads it. `portable` links it by zig for manylinux 2.28, as other machines need it: once more from scratch.
    """
    tools = environment(session, "portable" if portable else "build", MATURIN + (ZIG if portable else []))
    folder = DIST if portable else LOCAL
    for old in folder.glob("oncue_core-*.whl"):
        old.unlink()
    session.run(sys.executable, "tools/dependencies.py", "notices", str(NOTICES))
    command = [str(tools), "-m", "maturin", "build", "--release", "--out", str(folder)]
    command += ["--interpreter", str(tools)]
    if portable and sys.platform == "linux":
        command += ["--zig", "--compatibility", "manylinux_2_28"]
    # maturin looks for zig in the environment that is active.
    path = f"{tools.parent}{os.pathsep}{os.environ['PATH']}"
    session.run(*command, env={"VIRTUAL_ENV": str(tools.parents[1]), "PATH": path})
    (wheel,) = folder.glob("oncue_core-*.whl")
    with zipfile.ZipFile(wheel) as zipped:
        if not any(name.endswith(f"licenses/{NOTICES.name}") for name in zipped.namelist()):
            session.error(f"{wheel.name} lacks {NOTICES.name}.")
    return wheel


def extension_command(session: nox.Session, blender: Blender) -> list[str]:
    """Blender's own command for building and validating extensions, which runs without Blender."""
    python = blender_environment(session, blender)
    (tool,) = python.parents[1].glob("lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    return [str(python), str(tool)]


def build_extension(session: nox.Session, wheel: Path) -> Path:
    """The extension's archive with `wheel` in it, built and validated by Blender's own command."""
    command = extension_command(session, blenders(session)[-1])
    staging = LOCAL / "extension"
    shutil.rmtree(staging, ignore_errors=True)
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc")
    shutil.copytree(ROOT / "addon", staging, ignore=ignored)
    shutil.copy2(NOTICES, staging)
    # Sentences about captures name it.
    (staging / "docs").mkdir()
    shutil.copy2(ROOT / "docs" / "captures.md", staging / "docs")
    session.run(sys.executable, "tools/guide_pages.py", str(staging / "guide"), silent=True)
    (staging / "wheels").mkdir()
    shutil.copy2(wheel, staging / "wheels")
    manifest = staging / "blender_manifest.toml"
    manifest.write_text(with_wheel(manifest.read_text(), wheel))
    for old in wheel.parent.glob("oncue-*.zip"):
        old.unlink()
    session.run(*command, "build", "--source-dir", str(staging), "--output-dir", str(wheel.parent))
    (archive,) = wheel.parent.glob("oncue-*.zip")
    session.run(*command, "validate", str(archive))
    with zipfile.ZipFile(archive) as zipped:
        (inside,) = (name for name in zipped.namelist() if name.endswith(".whl"))
        if digest(zipped.read(inside)) != digest(wheel.read_bytes()):
            session.error(f"{inside} in {archive.name} is not the wheel that was built.")
    return archive


def of_the_window(archive: Path) -> dict[str, str]:
    """What those who start the real program go by: the extension's archive, and the Debian that it is in."""
    root = os.environ.get("ONCUE_WINDOW_ROOT", str(ENVIRONMENTS / "debian-13-blender"))
    return {"ONCUE_EXTENSION": str(archive), "ONCUE_WINDOW_ROOT": root}


def with_wheel(manifest: str, wheel: Path) -> str:
    """The manifest naming `wheel`, its platform and its version."""
    platforms = {"linux.*_x86_64": "linux-x64", "macosx.*_arm64": "macos-arm64", "macosx.*_x86_64": "macos-x64"}
    platforms |= {"win_amd64": "windows-x64", "win_arm64": "windows-arm64", "linux.*_aarch64": "linux-arm64"}
    platform = next(name for tag, name in platforms.items() if re.search(tag, wheel.name))
    version = wheel.name.split("-")[1]
    manifest = re.sub(r"(?m)^(wheels|platforms) = \[[^]]*\]\n", "", manifest)
    manifest = re.sub(r'(?m)^version = ".*"$', f'version = "{version}"', manifest, count=1)
    added = f'platforms = ["{platform}"]\nwheels = ["./wheels/{wheel.name}"]\n'
    # Before the first table, where plain keys end.
    head, table, rest = manifest.partition("\n[")
    return f"{head.rstrip()}\n{added}{table}{rest}"


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def typed_files() -> list[str]:
    """The extension's files that mypy checks: all that use nothing of Blender's, which has no types."""
    blender = re.compile(r"^\s*(import|from) (bpy|bmesh|mathutils|gpu|gpu_extras|bpy_extras)\b", re.MULTILINE)
    files = sorted((ROOT / "addon").rglob("*.py"))
    return [str(file.relative_to(ROOT)) for file in files if not blender.search(file.read_text(encoding="utf-8"))]


# --- the verbs ------------------------------------------------------------------------------------


@nox.session
def test(session: nox.Session) -> None:
    """All tests; `-- --all` for every Blender instead of the oldest and the newest."""
    every = "--all" in session.posargs
    posargs = [argument for argument in session.posargs if argument != "--all"]
    # The whole workspace, so that every crate has the features that it has in the wheel, and is compiled once.
    session.run("cargo", "test", "--release", "--locked", "--workspace", external=True)
    wheel = build_wheel(session)
    python = environment(session, "core", CORE_TESTS)
    install_wheel(session, python, wheel)
    session.run(str(python), "-m", "pytest", "tests", "--ignore=tests/addon", "--ignore=tests/window", *posargs)
    archive = build_extension(session, wheel)
    found = blenders(session)
    for blender in found if every else dict.fromkeys([found[0], found[-1]]):
        # The same core outside the archive, in place of one that `demo` may have left there.
        python = blender_environment(session, blender, wheel)
        session.log(f"Blender {blender.version}")
        # In one process with all the others Blender 4.2.23 has crashed as one of these tests deletes a scene.
        alone = "tests/addon/test_what_is_said.py"
        for part in (["tests/addon", f"--ignore={alone}"], [alone]):
            resources = LOCAL / f"resources-{blender.version}"
            shutil.rmtree(resources, ignore_errors=True)
            session.run(
                *[str(python), "-m", "pytest", *part, "--timeout=600", *posargs],
                env={"BLENDER_USER_RESOURCES": str(resources), "ONCUE_EXTENSION": str(archive)},
                # 5: what was asked for is in the other part.
                success_codes=[0, 5] if posargs else [0],
            )


@nox.session
def lint(session: nox.Session) -> None:
    """Formatting, clippy, the crate's documentation, the dependencies' terms and versions, ruff and mypy."""
    session.run("cargo", "fmt", "--all", "--check", external=True)
    session.run(sys.executable, "tools/dependencies.py", "check")
    clippy = ["cargo", "clippy", "--release", "--locked", "--workspace", "--all-targets"]
    session.run(*clippy, "--", "--deny", "warnings", external=True)
    documented = ["cargo", "doc", "--release", "--locked", "--no-deps", "--package", "oncue"]
    session.run(*documented, external=True, env={"RUSTDOCFLAGS": "--deny warnings"})
    session.run("cargo", "test", "--release", "--locked", "--package", "oncue", "--doc", external=True)
    python = environment(session, "lint", LINTERS)
    session.run(str(python), "-m", "ruff", "check")
    session.run(str(python), "-m", "ruff", "format", "--check")
    files = ["rust/oncue-python/oncue_core", "noxfile.py", "tools/dependencies.py", *typed_files()]
    session.run(str(python), "-m", "mypy", *files)


@nox.session
def deny(session: nox.Session) -> None:
    """cargo-deny's own reading of deny.toml, for when dependencies change.

    It takes five minutes of one core to compile, into `.nox/cargo-deny`, which a new machine has to do each time: so
    `lint`, and with it CI, holds the dependencies to the same rules by tools/dependencies.py. Advisories need a
    database from the network and are asked for by name: `-- advisories`.
    """
    folder = ENVIRONMENTS / "cargo-deny"
    if not (folder / "bin").is_dir():
        install = ["cargo", "install", "--locked", "--root", str(folder), "--version", CARGO_DENY, "cargo-deny"]
        session.run(*install, external=True)
    what = session.posargs or ["licenses", "bans", "sources"]
    session.run(str(folder / "bin" / "cargo-deny"), "--locked", "check", *what, external=True)


@nox.session
def build(session: nox.Session) -> None:
    """The extension's archive for everybody: portable wheel, validated archive, in `dist/`."""
    wheel = build_wheel(session, portable=True)
    python = environment(session, "core", CORE_TESTS)
    install_wheel(session, python, wheel)
    session.run(str(python), "-c", "import oncue_core; print('oncue_core', oncue_core.__version__, 'loads')")
    session.log(f"The extension is {build_extension(session, wheel).relative_to(ROOT)}")


@nox.session
def demo(session: nox.Session) -> None:
    """Builds everything, makes the demo room, has a person walk through it and sit down, and draws it."""
    blender = blenders(session)[-1]
    python = str(blender_environment(session, blender, build_wheel(session)))
    rooms = LOCAL / "rooms"
    session.run(python, "blend_fixtures/make_fixtures.py", "--out", str(rooms), "--only", "demo_room", silent=True)
    blend, report, picture, video = (OUT / f"demo.{ending}" for ending in ("blend", "json", "png", "mp4"))
    command = [python, "addon/batch.py", str(rooms / "demo_room.blend"), "--out", str(blend), "--report", str(report)]
    # 3: there is a motion, but it missed a cue. It is worth a picture all the more.
    session.run(*command, *session.posargs, success_codes=[0, 3])
    session.log("Drawing the picture and the video")
    files = ["--picture", str(picture), "--video", str(video)]
    # Without a display EGL complains at every frame; the output is shown when the drawing fails.
    session.run(python, "blend_fixtures/render.py", str(blend), *files, silent=True)
    for file in (blend, report, picture, video):
        print(f"{file.relative_to(ROOT)}  {file.stat().st_size / 1e6:.1f} MB")
    figures = json.loads(report.read_text())
    for line in summary(figures):
        print(line)
    if not figures["success"]:
        session.error("The demo's cue was not met.")


def summary(report: dict[str, Any]) -> list[str]:
    """A report's figures in words."""
    lines = [
        f"{cue['cue']}: pelvis {cue['pelvis_cm']:.1f} cm and facing {cue['facing_degrees']:.1f}° from the cue"
        for cue in report["cues"]
    ]
    foot, penetration = report["foot"], report["penetration"]
    lines += [
        f"foot contact {foot['contact_cm']:.2f} cm, feet near the floor move {foot['low_skate_cm']:.2f} cm a frame",
        f"legs or arms in the scene in {penetration['percent']:.1f} % of the frames, "
        f"any part in {penetration['whole_body_percent']:.1f} %",
        f"{report['frames'] / 30:.1f} s of motion, found in {sum(report['seconds'].values()):.0f} s "
        f"and {report['updates']} updates",
        *report["problems"],
    ]
    return lines


@nox.session
def synthesize(session: nox.Session) -> None:
    """`-- scene.blend --out out.blend --report out.json --seed 1 [--library FILE_OR_FOLDER …]`."""
    python = blender_environment(session, blenders(session)[-1], build_wheel(session))
    session.run(str(python), "addon/batch.py", *session.posargs)


@nox.session
def fixtures(session: nox.Session) -> None:
    """Blend files with cues in place: the own rooms, or `-- --room ROOM.glb --tasks rooms.tsv --out DIR`.

    With `--shots shots.tsv` in place of the tasks, those of that room's shots (blend_fixtures/shots.py).
    """
    python = blender_environment(session, blenders(session)[-1])
    arguments = session.posargs or ["--out", str(LOCAL / "rooms")]
    session.run(str(python), "blend_fixtures/make_fixtures.py", *arguments)


@nox.session
def examples(session: nox.Session) -> None:
    """The scenes that docs/guide speaks of, each ready for Synthesize, into out/examples; `-- --only seats` for one."""
    python = blender_environment(session, blenders(session)[-1])
    session.run(str(python), "blend_fixtures/examples.py", "--out", str(OUT / "examples"), *session.posargs)


@nox.session
def window(session: nox.Session) -> None:
    """The button, pressed with the mouse in the real program, put into `.nox/debian-13-blender` (needs root)."""
    archive = build_extension(session, build_wheel(session))
    python = blender_environment(session, blenders(session)[-1])
    session.run(*[str(python), "-m", "pytest", "tests/window", *session.posargs], env=of_the_window(archive))


@nox.session
def guide(session: nox.Session) -> None:
    """The pictures of docs/guide, made in the real program (needs root); `-- --only seats-edge` for some of them."""
    wheel = build_wheel(session)
    archive = build_extension(session, wheel)
    python = blender_environment(session, blenders(session)[-1], wheel)
    tools = environment(session, "tools", ["pillow"])
    command = [str(tools), "tools/guide_pictures.py", "--python", str(python), *session.posargs]
    session.run(*command, env=of_the_window(archive))


@nox.session
def situations(session: nox.Session) -> None:
    """Scenes and captures as artists have them, with what is said of each: docs/situations.md."""
    python = blender_environment(session, blenders(session)[-1], build_wheel(session))
    session.run(str(python), "tools/situations.py", *session.posargs)


@nox.session
def fuzz(session: nox.Session) -> None:
    """Reads files that were changed at random, a million over all kinds, and counts; `-- 100000 7` for fewer by a seed.

    The page goes to out/fuzz.md, and with `-- --docs` to docs/fuzz.md too. Fails where anything panicked, hung or was
    read as nonsense.
    """
    given = [argument for argument in session.posargs if argument != "--docs"]
    command = ["cargo", "run", "--release", "--locked", "--package", "oncue", "--example", "fuzz", "--"]
    page = session.run(*command, *given, external=True, silent=True, stderr=None)
    OUT.mkdir(exist_ok=True)
    folders = [OUT, ROOT / "docs"] if "--docs" in session.posargs else [OUT]
    for folder in folders:
        (folder / "fuzz.md").write_text(str(page), encoding="utf-8")
    print(page)


@nox.session
def rooms(session: nox.Session) -> None:
    """The tables and contact sheets of docs/rooms, from `../shared/data`; `-- --table objects` for one of them."""
    python = blender_environment(session, blenders(session)[-1], build_wheel(session))
    tools = environment(session, "tools", ["pillow"])
    session.run(str(tools), "tools/rooms_table.py", "--python", str(python), *session.posargs)


@nox.session
def rigs(session: nox.Session) -> None:
    """docs/rigs.md: rigs of other programs in real rooms, measured on what was written; `-- --rigs daz` for one."""
    python = blender_environment(session, blenders(session)[-1], build_wheel(session))
    session.run(str(python), "blend_fixtures/rigs_table.py", *session.posargs)


@nox.session
def sheets(session: nox.Session) -> None:
    """docs/motion.md: contact sheets of motions at a person's height, and a short video; `-- --only start` for some."""
    python = blender_environment(session, blenders(session)[-1], build_wheel(session))
    tools = environment(session, "tools", ["pillow"])
    session.run(str(tools), "tools/motion_sheets.py", "--python", str(python), *session.posargs)


@nox.session
def shots(session: nox.Session) -> None:
    """docs/shots.md: whole shots, one to three people, in real rooms; `-- --only ROOM-SHOT` for some, `--keep`."""
    python = blender_environment(session, blenders(session)[-1], build_wheel(session))
    tools = environment(session, "tools", ["pillow"])
    session.run(str(tools), "tools/shots_table.py", "--python", str(python), *session.posargs)


@nox.session
def evaluate(session: nox.Session) -> None:
    """Replays the paper's tables on real rooms (tools/evaluation); `-- --quick` for a few tasks."""
    python, wheel = environment(session, "evaluate", EVALUATION), build_wheel(session)
    install_wheel(session, python, wheel)
    shared = os.environ.get("ONCUE_SHARED", str(ROOT.parent / "shared"))
    command = [str(python), "-m", "tools.evaluation", "--shared", shared, "--out", str(OUT / "evaluation")]
    # Only the editor's section has pictures that Blender draws.
    if "--quick" not in session.posargs and ("--only" not in session.posargs or "editing" in session.posargs):
        command += ["--blender", str(blender_environment(session, blenders(session)[-1], wheel))]
    session.run(*command, *session.posargs)


@nox.session
def manifold(session: nox.Session) -> None:
    """Trains a motion manifold: `-- --library FOLDER … --out FILE [--seed N] [--checkpoint FILE] [--settings JSON]`.

    The same command gives the same file on any number of cores of one kind. That of the manifold that ships is in
    docs/manifold.md.
    """
    command = ["cargo", "run", "--release", "--locked", "--package", "oncue", "--example", "manifold", "--"]
    session.run(*command, *session.posargs, external=True)


@nox.session
def bench(session: nox.Session) -> None:
    """Search, collision, environment steps, updates and latent steps, each beside what else there is (tools/peers)."""
    peers = environment(session, "peers", PEERS)
    command = ["cargo", "bench", "--locked", "--workspace", "--bench", "*", *session.posargs]
    session.run(*command, external=True, env={"ONCUE_PEERS": str(peers)})


@nox.session
def mutants(session: nox.Session) -> None:
    """Breaks the core in many places and writes to docs/mutants.md what its unit tests notice.

    `-- --sample 60 --seed 1 [--shard 0/4] [--no-breaks] [--no-report]`. Takes about half a minute a mutant.
    """
    root = ENVIRONMENTS / "cargo-mutants"
    tool = root / "bin" / "cargo-mutants"
    install = ["cargo", "install", "--locked", "--quiet", "--root", str(root), "--version", CARGO_MUTANTS]
    # Does nothing where this version is there.
    session.run(*install, "cargo-mutants", external=True)
    command = [sys.executable, "tools/mutants.py", "--tool", str(tool)]
    session.run(*(["nice"] if shutil.which("nice") else []), *command, *session.posargs, external=True)
