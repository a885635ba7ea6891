"""The documents hold together: decisions numbered without holes, and no link to a file that is not there."""

import re
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[1]
DECISIONS = ROOT / "docs" / "decisions"
NOT_OURS = {"target", "out", "dist", ".nox", ".git", ".venv", ".pytest_cache", "node_modules"}
DOCUMENTS = sorted(path for path in ROOT.rglob("*.md") if not NOT_OURS.intersection(path.relative_to(ROOT).parts[:-1]))
#: `[text](target)` and `![text](target)`.
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
#: `decision 8`, `decisions 5 and 8`.
REFERENCE = re.compile(r"\bdecisions? (\d+)(?:(?:, | and )(\d+))*\b")
#: Where else a decision may be named.
SOURCES = sorted(
    path
    for folder in ("rust", "addon", "tools", "tests")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in {".rs", ".py"}
)


def name_of(path):
    return path.relative_to(ROOT).as_posix()


def numbers():
    return [int(path.name.split("-")[0]) for path in sorted(DECISIONS.glob("*.md"))]


def test_decisions_are_numbered_without_holes():
    assert numbers() == list(range(1, len(numbers()) + 1))


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_links_to_files_resolve(document):
    for target in LINK.findall(document.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:|#", target):
            continue
        path = document.parent / unquote(target.partition("#")[0])
        assert path.exists(), target


def test_decisions_that_are_named_exist():
    known = set(numbers())
    for path in [*DOCUMENTS, *SOURCES]:
        # This file's own examples are no references.
        if path == Path(__file__):
            continue
        for match in REFERENCE.finditer(path.read_text(encoding="utf-8")):
            named = {int(number) for number in re.findall(r"\d+", match.group())}
            assert named <= known, f"{name_of(path)}: {match.group()}"
        for file in re.findall(r"decisions/(\d{4}[\w-]*\.md)", path.read_text(encoding="utf-8")):
            assert (DECISIONS / file).exists(), f"{name_of(path)}: {file}"


#: A source file as the documents write it: `scene/mod.rs`, from the core's sources or from the root.
SOURCE_PATH = re.compile(r"`([\w./-]+/[\w.-]+\.(?:rs|py))`")


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_source_files_that_are_named_exist(document):
    from_here = [ROOT, ROOT / "rust" / "oncue" / "src", ROOT / "rust" / "oncue", ROOT / "addon"]
    for path in SOURCE_PATH.findall(document.read_text(encoding="utf-8")):
        assert any((folder / path).exists() for folder in from_here), f"{name_of(document)}: {path}"


@pytest.mark.parametrize("crate", ["oncue", "oncue-python"])
@pytest.mark.parametrize("terms", ["LICENSE-MIT", "LICENSE-APACHE"])
def test_a_crate_that_is_packed_alone_has_its_terms(crate, terms):
    assert (ROOT / "rust" / crate / terms).read_bytes() == (ROOT / terms).read_bytes()
