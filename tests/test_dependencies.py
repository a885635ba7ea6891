"""tools/dependencies.py: what it lets pass and what not."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
specification = importlib.util.spec_from_file_location("dependencies", ROOT / "tools" / "dependencies.py")
dependencies = importlib.util.module_from_spec(specification)
specification.loader.exec_module(dependencies)

RULES = {"licenses": {"allow": ["MIT", "Zlib"]}, "bans": {"skip": [{"crate": "old@1.0.0"}]}}
REGISTRY = "registry+index"
OLD = dependencies.Package("old", "1.0.0", "MIT", None, REGISTRY, (), Path("/registry/old-1.0.0"))


def complaints(**changes):
    return dependencies.complaints([OLD, OLD._replace(name="new", **changes)], RULES, "1.80")


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("MIT", True),
        ("GPL-3.0-only", False),
        ("MIT OR GPL-3.0-only", True),
        ("GPL-3.0-only/MIT", True),
        ("MIT AND GPL-3.0-only", False),
        ("(MIT OR GPL-3.0-only) AND Zlib", True),
        ("(GPL-3.0-only OR MIT) AND LGPL-3.0-only", False),
        # AND binds before OR.
        ("MIT OR Zlib AND GPL-3.0-only", True),
        ("MIT WITH LLVM-exception", False),
        ("", False),
        ("MIT Zlib", False),
    ],
)
def test_licence_expressions(expression, expected):
    assert dependencies.is_allowed(expression, {"MIT", "Zlib"}) is expected


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"licence": "GPL-3.0-only"}, "GPL-3.0-only"),
        ({"licence": None}, "no licence"),
        ({"rust": "1.81"}, "needs Rust 1.81"),
        ({"rust": "1.80.1"}, "needs Rust 1.80.1"),
        ({"source": "git+somewhere"}, "git+somewhere"),
        ({"source": None}, "/registry"),
    ],
)
def test_each_rule_complains(changes, word):
    (sentence,) = complaints(**changes)
    assert word in sentence
    assert sentence.startswith("new 1.0.0 ")


@pytest.mark.parametrize("changes", [{"rust": "1.80.0"}, {"rust": "1.9"}, {"licence": "Zlib OR GPL-3.0-only"}])
def test_what_is_allowed_passes(changes):
    assert complaints(**changes) == []


def test_double_versions_and_stale_exceptions():
    twice = [OLD._replace(name="new"), OLD._replace(name="new", version="2.0.0")]
    assert dependencies.complaints([OLD, *twice], RULES, "1.80") == ["new is there as 1.0.0 and 2.0.0."]
    assert dependencies.complaints([OLD, OLD._replace(version="2.0.0")], RULES, "1.80") == []
    assert dependencies.complaints(twice[:1], RULES, "1.80") == [
        "deny.toml skips old@1.0.0, which is not there any more."
    ]


def test_terms_are_the_packages_own(tmp_path):
    package = OLD._replace(folder=tmp_path, licence="MIT OR Apache-2.0", authors=("A. Person <a@b.c>",))
    (text,) = dependencies.terms(package)
    assert "Copyright (c) A. Person\n" in text
    assert "WITHOUT WARRANTY OF ANY KIND" in text
    (tmp_path / "LICENSE-APACHE").write_text("apache")
    assert dependencies.terms(package) == ["apache"]
    (tmp_path / "LICENSE-MIT").write_text("mit\n")
    (tmp_path / "NOTICE").write_text("notice")
    (tmp_path / "license.rs").write_text("code")
    assert dependencies.terms(package) == ["mit", "notice"]
    assert dependencies.terms(package._replace(licence="MIT AND Apache-2.0")) == ["apache", "mit", "notice"]
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(SystemExit, match="has no text of its licence"):
        dependencies.terms(package._replace(folder=empty, licence="Apache-2.0"))
