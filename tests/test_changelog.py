"""tools/changelog.py: a release has the notes of its version, and none comes out that is not closed."""

import pytest

from tools.changelog import ROOT, NotReady, notes

TEXT = """# Changelog

## 0.2.0 — 2027-01-02

- Second.

### Fixed

- A thing.

## 0.1.0 — unreleased

First version.
"""


def test_the_notes_are_those_of_the_version():
    assert notes(TEXT, "v0.2.0", "0.2.0") == "- Second.\n\n### Fixed\n\n- A thing.\n"


@pytest.mark.parametrize(
    ("tag", "version", "word"),
    [
        ("v0.2.1", "0.2.0", "Cargo.toml has version 0.2.0"),
        ("0.2.0", "0.2.0", "The tag is 0.2.0"),
        ("v0.3.0", "0.3.0", "nothing of 0.3.0"),
        ("v0.1.0", "0.1.0", "no date for 0.1.0"),
    ],
)
def test_what_is_not_ready_is_a_sentence(tag, version, word):
    with pytest.raises(NotReady, match=word):
        notes(TEXT, tag, version)


def test_the_changelog_can_be_released_once_it_has_a_date():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").replace("unreleased", "2027-01-01")
    assert notes(text, "v0.1.0", "0.1.0").startswith("First version.")
