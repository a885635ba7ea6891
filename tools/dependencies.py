"""Our Rust dependencies held to deny.toml, and the notices of those that ship.

    python tools/dependencies.py check
    python tools/dependencies.py notices FILE

Reads `cargo metadata`, `cargo tree` and the sources in cargo's registry. `check` fails where a licence is not allowed,
where a dependency is there in two versions, comes from elsewhere than the registry, or asks for a newer Rust than
`rust-version` promises. But for the last that is what cargo-deny does, in a second where that one has to be compiled
first. `notices` finds what cargo-bundle-licenses does not (blake3's files have other names, bvh_anim has none) and
lists what is in the library alone, not what belongs to other platforms and to the tests.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
RULES = ROOT / "deny.toml"
#: The crate whose library ships.
SHIPPED = "oncue-python"
#: Files at a package's root that hold its terms.
TERMS = re.compile(r"(licen[sc]e|copying|unlicense|notice|copyright)", re.IGNORECASE)


class Package(NamedTuple):
    """A dependency, as its manifest describes it."""

    name: str
    version: str
    licence: str | None
    rust: str | None
    source: str | None
    authors: tuple[str, ...]
    folder: Path

    @property
    def label(self) -> str:
        return f"{self.name} {self.version}"


def cargo(*arguments: str) -> str:
    command = ["cargo", *arguments]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def manifests() -> dict[tuple[str, str], Package]:
    """Every package of Cargo.lock, by name and version."""
    found = json.loads(cargo("metadata", "--locked", "--format-version", "1"))["packages"]
    packages = (
        Package(
            p["name"],
            p["version"],
            p["license"],
            p["rust_version"],
            p["source"],
            tuple(p["authors"]),
            Path(p["manifest_path"]).parent,
        )
        for p in found
    )
    return {(p.name, p.version): p for p in packages}


def used(targets: list[str], *what: str) -> set[tuple[str, str]]:
    """Name and version of all that is compiled for one of the targets; Cargo.lock has more."""
    lines: set[str] = set()
    for target in targets:
        lines.update(cargo("tree", "--locked", "--target", target, "--prefix", "none", *what).splitlines())
    pairs = (line.split()[:2] for line in lines if line)
    return {(name, version.removeprefix("v")) for name, version in pairs}


def is_allowed(expression: str, allowed: set[str]) -> bool:
    """Whether an SPDX expression can be met by allowed licences alone; `/` is the old way to write OR."""
    words = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))

    def either() -> bool:
        result = both()
        while words and words[0] == "OR":
            words.pop(0)
            right = both()
            result = result or right
        return result

    def both() -> bool:
        result = one()
        while words and words[0] == "AND":
            words.pop(0)
            right = one()
            result = result and right
        return result

    def one() -> bool:
        word = words.pop(0) if words else ""
        if word == "(":
            result = either()
            if words:
                words.pop(0)
            return result
        if words and words[0] == "WITH":
            word = f"{word} WITH {words[1]}"
            del words[:2]
        return word in allowed

    return either() and not words


def as_numbers(version: str) -> tuple[int, ...]:
    """1.70 and 1.70.0 are one version."""
    numbers = [int(part) for part in version.split(".")]
    return tuple(numbers + [0] * (3 - len(numbers)))


def complaints(packages: list[Package], rules: dict[str, Any], rust: str) -> list[str]:
    """A sentence for each rule that a package breaks."""
    found = []
    allowed = set(rules["licenses"]["allow"])
    skipped = {skip["crate"] for skip in rules["bans"]["skip"]}
    by_name: dict[str, list[Package]] = {}
    for package in packages:
        by_name.setdefault(package.name, []).append(package)
        if not package.licence:
            found.append(f"{package.label} names no licence.")
        elif not is_allowed(package.licence, allowed):
            found.append(f"{package.label} is under {package.licence}, which deny.toml does not allow.")
        if package.rust and as_numbers(package.rust) > as_numbers(rust):
            found.append(f"{package.label} needs Rust {package.rust}; rust-version promises {rust}.")
        if package.source is None and ROOT not in package.folder.parents:
            found.append(f"{package.label} comes from {package.folder}.")
        if package.source is not None and not package.source.startswith("registry+"):
            found.append(f"{package.label} comes from {package.source}.")
    for name, several in by_name.items():
        kept = [p for p in several if f"{name}@{p.version}" not in skipped]
        if len(several) > 1 and len(kept) > 1:
            found.append(f"{name} is there as {' and '.join(sorted(p.version for p in several))}.")
    labels = {f"{p.name}@{p.version}" for p in packages}
    found += [f"deny.toml skips {crate}, which is not there any more." for crate in sorted(skipped - labels)]
    return found


def check() -> list[str]:
    rules = tomllib.loads(RULES.read_text(encoding="utf-8"))
    rust = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["rust-version"]
    known = manifests()
    names = used(rules["graph"]["targets"], "--workspace", "--edges", "normal,build,dev")
    return complaints([known[name] for name in sorted(names)], rules, rust)


def terms(package: Package) -> list[str]:
    """The texts of a package's terms: of several licences to choose from the MIT one alone, and every notice.

    A package that names the MIT licence and leaves out its text gets the text, with the package's authors.
    """
    files = sorted(path for path in package.folder.iterdir() if path.is_file() and TERMS.search(path.name))
    files = [path for path in files if path.suffix.lower() in {"", ".md", ".txt"} or TERMS.search(path.suffix)]
    notices = [path for path in files if "notice" in path.name.lower()]
    mit = [path for path in files if re.search(r"[-_.]mit\b", path.name.lower())]
    if mit and is_allowed(package.licence or "", {"MIT"}):
        files = mit + [path for path in notices if path not in mit]
    texts = [path.read_text(encoding="utf-8", errors="replace").strip() for path in files]
    if not texts and is_allowed(package.licence or "", {"MIT"}):
        holders = ", ".join(re.sub(r"\s*<[^>]*>", "", author) for author in package.authors)
        ours = (ROOT / "LICENSE-MIT").read_text(encoding="utf-8").strip()
        notice = f"Copyright (c) {holders or f'the authors of {package.name}'}"
        texts = [re.sub(r"(?m)^Copyright .*$", notice, ours, count=1)]
    if not texts:
        sys.exit(f"{package.label} ({package.licence}) has no text of its licence in {package.folder}.")
    return texts


def shipped() -> set[tuple[str, str]]:
    """Name and version of every package in the compiled library of any platform."""
    rules = tomllib.loads(RULES.read_text(encoding="utf-8"))
    return used(rules["graph"]["targets"], "--package", SHIPPED, "--edges", "normal,no-proc-macro")


def notices() -> str:
    """Name, version, licence and terms of every package in the compiled library; what several share stands once."""
    known = manifests()
    packages = [known[name] for name in sorted(shipped()) if known[name].source]
    by_text: dict[str, list[Package]] = {}
    for package in packages:
        for text in terms(package):
            by_text.setdefault(text, []).append(package)
    intro = "oncue_core, the compiled core of Oncue, holds the Rust standard library and the packages below."
    lines = [intro, "The standard library is by The Rust Project Developers, under MIT OR Apache-2.0.", ""]
    lines += [f"{p.label}: {p.licence}" for p in packages]
    for text, sharing in by_text.items():
        of = ", ".join(dict.fromkeys(p.label for p in sharing))
        lines += ["", "-" * 100, *textwrap.wrap(of, 100), "", text]
    return "\n".join(lines) + "\n"


def main() -> None:
    match sys.argv[1:]:
        case ["check"]:
            found = check()
            print("\n".join(found) or "The dependencies are as deny.toml wants them.")
            sys.exit(bool(found))
        case ["notices", file]:
            Path(file).write_text(notices(), encoding="utf-8")
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
