"""A Debian 13 with the real Blender program, an X server without a screen and a mouse that a script moves.

Made once (about 70 s, 330 MB to download, 1.6 GB on disk; needs root) in the folder that ONCUE_WINDOW_ROOT names,
`~/.cache/oncue/debian-13-blender` by default.
"""

import os
import shutil
import subprocess
from pathlib import Path

PACKAGES = [
    *("blender", "python3-numpy", "imagemagick"),
    *("libgl1-mesa-dri", "libgl1", "libegl1", "libegl-mesa0", "libglx-mesa0"),
    *("xvfb", "xauth", "xdotool", "openbox"),
]
READY = "oncue-blender-is-ready"


class Unavailable(Exception):
    """Why there can be no real Blender here."""


def blender_root() -> Path:
    """The root folder of the Debian, made when it is missing. Raises Unavailable."""
    default = Path.home() / ".cache" / "oncue" / "debian-13-blender"
    root = Path(os.environ.get("ONCUE_WINDOW_ROOT", default)).resolve()
    if (root / READY).exists():
        return root
    if os.geteuid() != 0:
        raise Unavailable(f"{root} has no Blender, and making one needs root")
    if not shutil.which("debootstrap"):
        _run(["apt-get", "update", "-qq"], check=False)
        _run(["apt-get", "install", "-y", "-qq", "--no-install-recommends", "debootstrap"], check=False)
    if not shutil.which("debootstrap"):
        raise Unavailable("debootstrap is missing and could not be installed")
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    _run(["debootstrap", "--variant=minbase", "trixie", str(root)])
    # No service may start in there.
    policy = root / "usr/sbin/policy-rc.d"
    policy.write_text("#!/bin/sh\nexit 101\n")
    policy.chmod(0o755)
    _run(["chroot", str(root), "apt-get", "update", "-qq"])
    install = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", *PACKAGES]
    _run(["chroot", str(root), "env", "DEBIAN_FRONTEND=noninteractive", *install])
    _run(["chroot", str(root), "apt-get", "clean"])
    (root / READY).write_text("")
    return root


def _run(command: list[str], check: bool = True) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise Unavailable(f"{command[0]}: {error}") from error
    if check and done.returncode:
        raise Unavailable(f"{' '.join(command[:4])} failed: {done.stderr.strip()[-400:]}")
