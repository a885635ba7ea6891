"""The build verb of noxfile.py: platforms, and why one of them cannot be built here."""

import sys
import tomllib
from pathlib import Path

import pytest

pytest.importorskip("nox")
import noxfile
from noxfile import PLATFORMS, CannotBuild, platform_of, with_wheels

WHEELS = {
    "linux-x64": "manylinux_2_28_x86_64",
    "linux-arm64": "manylinux_2_28_aarch64",
    "windows-x64": "win_amd64",
    "windows-arm64": "win_arm64",
    "macos-arm64": "macosx_11_0_arm64",
    "macos-x64": "macosx_11_0_x86_64",
}


def wheel(platform):
    return Path(f"oncue_core-0.1.0-cp311-abi3-{WHEELS[platform]}.whl")


def test_each_platform_has_its_wheel():
    assert {platform.name for platform in PLATFORMS} == WHEELS.keys()
    for name in WHEELS:
        assert platform_of(wheel(name)).name == name
    # As maturin names one that only this machine loads.
    assert platform_of(Path("oncue_core-0.1.0-cp311-abi3-linux_x86_64.whl")).name == "linux-x64"


def test_the_manifest_names_the_wheels_before_its_first_table():
    manifest = (noxfile.ROOT / "addon" / "blender_manifest.toml").read_text(encoding="utf-8")
    # Twice: what an earlier build has left is replaced.
    once = with_wheels(manifest, [wheel("macos-x64")])
    read = tomllib.loads(with_wheels(once, [wheel(name) for name in WHEELS]))
    assert read["platforms"] == list(WHEELS)
    assert read["wheels"] == [f"./wheels/{wheel(name)}" for name in WHEELS]
    assert read["version"] == "0.1.0"
    assert {"copyright", "website", "permissions"} <= read.keys()


@pytest.fixture
def bare(monkeypatch, tmp_path):
    """A machine with a compiler for itself alone."""
    answers = {"--print": str(tmp_path), "--version": "rustc 1.95.0 (0 2026-04-14)"}
    monkeypatch.setattr(noxfile, "output_of", lambda *command: answers[command[1]])
    monkeypatch.setattr(noxfile, "ENVIRONMENTS", tmp_path / "nox")
    monkeypatch.setattr(noxfile, "HERE", "linux")
    monkeypatch.delenv("ONCUE_RUST_SOURCES", raising=False)
    return tmp_path


def recipe(platform, folder):
    (found,) = (each for each in PLATFORMS if each.name == platform)
    return noxfile.recipe(found, folder / "python")


def test_a_library_that_is_installed_is_used(bare):
    (bare / "lib" / "rustlib" / "aarch64-apple-darwin" / "lib").mkdir(parents=True)
    arguments, env = recipe("macos-arm64", bare)
    assert arguments == ["--target", "aarch64-apple-darwin", "--zig"]
    assert env == {"MACOSX_DEPLOYMENT_TARGET": "11.0"}


def test_without_a_library_and_sources_it_is_said_what_to_do(bare):
    with pytest.raises(CannotBuild, match=r"`rustup target add aarch64-apple-darwin`.*ONCUE_RUST_SOURCES"):
        recipe("macos-arm64", bare)


def test_sources_of_another_version_and_folders_without_sources_are_refused(bare, monkeypatch):
    sources = bare / "rust"
    monkeypatch.setenv("ONCUE_RUST_SOURCES", str(sources))
    with pytest.raises(CannotBuild, match="has no library/std"):
        recipe("linux-arm64", bare)
    (sources / "library" / "std").mkdir(parents=True)
    (sources / "library" / "std" / "Cargo.toml").touch()
    (sources / "version").write_text("1.97.1 (0 2026-09-01)\n", encoding="utf-8")
    with pytest.raises(CannotBuild, match=r"sources of Rust 1\.97\.1, and the compiler is 1\.95\.0"):
        recipe("linux-arm64", bare)


def test_sources_are_built_with_their_lock_file(bare, monkeypatch):
    sources = bare / "rust"
    monkeypatch.setenv("ONCUE_RUST_SOURCES", str(sources))
    (sources / "library" / "std").mkdir(parents=True)
    (sources / "library" / "std" / "Cargo.toml").touch()
    (sources / "Cargo.lock").write_text("locked", encoding="utf-8")
    arguments, env = recipe("linux-arm64", bare)
    assert arguments[-2:] == ["-Z", "build-std=std,panic_unwind"]
    library = Path(env["__CARGO_TESTS_ONLY_SRC_ROOT"])
    assert (library / "Cargo.lock").read_text(encoding="utf-8") == "locked"
    # Rust's sources, which may be the system's, stay as they are.
    assert not (sources / "library" / "Cargo.lock").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="there Microsoft's linker is used")
def test_windows_is_linked_with_the_list_of_exports_in_sight(bare):
    (bare / "lib" / "rustlib" / "x86_64-pc-windows-gnu" / "lib").mkdir(parents=True)
    (bare / "maturin").write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n', encoding="utf-8")
    (bare / "maturin").chmod(0o755)
    _, env = recipe("windows-x64", bare)
    linker = env["CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER"]
    given = ["a b.o", "-Wl,/x/list.def", "-Wl,--nxcompat"]
    done = noxfile.subprocess.run([linker, *given], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-3:] == ["a b.o", "/x/list.def", "-Wl,--nxcompat"]
