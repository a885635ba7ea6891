"""The notes of a release, from CHANGELOG.md.

    python -m tools.changelog TAG FILE

The tag is `v` and the version of Cargo.toml, and the changelog has that version with a date.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


class NotReady(Exception):
    """Why there can be no release of a tag: a sentence."""


def notes(changelog: str, tag: str, version: str) -> str:
    """What the changelog says of `version`, for the tag of that name. Raises NotReady."""
    if tag != f"v{version}":
        raise NotReady(f"The tag is {tag}, and Cargo.toml has version {version}.")
    sections = re.split(r"(?m)^## ", changelog)[1:]
    found = [section.partition("\n") for section in sections if section.split()[0] == version]
    if not found:
        raise NotReady(f"CHANGELOG.md says nothing of {version}.")
    heading, _, text = found[0]
    if not re.search(r"\d{4}-\d{2}-\d{2}$", heading.strip()):
        raise NotReady(f"CHANGELOG.md has no date for {version}: ‘{heading.strip()}’.")
    if not text.strip():
        raise NotReady(f"CHANGELOG.md has nothing under {version}.")
    return text.strip() + "\n"


def main() -> None:
    match sys.argv[1:]:
        case [tag, file]:
            version = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"][
                "version"
            ]
            try:
                text = notes((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), tag, version)
            except NotReady as why:
                sys.exit(str(why))
            Path(file).write_text(text, encoding="utf-8", newline="\n")
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
