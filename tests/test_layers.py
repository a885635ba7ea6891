"""The extension's import rules, read from its sources."""

import ast
from pathlib import Path

import pytest

ADDON = Path(__file__).parents[1] / "addon"
FILES = sorted(ADDON.rglob("*.py"))
#: Who may speak to Blender; everything else is arrays, and a script can use it without Blender.
BLENDER_MODULES = {"bpy", "bmesh", "mathutils", "gpu", "gpu_extras", "bpy_extras"}
MAY_USE_BLENDER = {
    "batch.py",
    "command_line.py",
    "job_operator.py",
    "manual.py",
    "overlay.py",
    "panels.py",
    "preferences.py",
    "properties.py",
    "translations.py",
}
FOLDERS_THAT_MAY = {"bridge", "operators"}


def name_of(path):
    return path.relative_to(ADDON).as_posix()


@pytest.fixture(params=FILES, ids=name_of)
def source(request):
    return request.param, ast.parse(request.param.read_text(encoding="utf-8"))


def imported(tree):
    """(level, module) of each import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.level, node.module or ""


def attributes(tree):
    """Dotted names that are read."""
    return {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


def test_there_are_sources():
    assert len(FILES) > 15


def test_only_the_bridge_and_the_interface_use_blender(source):
    path, tree = source
    uses = {module.split(".")[0] for level, module in imported(tree) if level == 0} & BLENDER_MODULES
    allowed = path.name in MAY_USE_BLENDER or path.relative_to(ADDON).parts[0] in FOLDERS_THAT_MAY
    assert allowed or not uses, f"{name_of(path)} imports {uses}"


def test_only_the_bridge_touches_the_file(source):
    path, tree = source
    if path.relative_to(ADDON).parts[0] == "bridge":
        return
    # The path of the open file is no datablock.
    touched = {name for name in attributes(tree) if name.startswith("bpy.data.") and name != "bpy.data.filepath"}
    assert not touched, f"{name_of(path)} reads {touched}"


def test_one_file_asks_for_the_version(source):
    path, tree = source
    asks = {name for name in attributes(tree) if name.startswith("bpy.app.version")}
    assert not asks or name_of(path) == "bridge/compat.py"


def test_one_file_imports_the_core(source):
    path, tree = source
    imports_it = any(module.split(".")[0] == "oncue_core" for _, module in imported(tree))
    assert imports_it == (name_of(path) == "native.py")


def test_the_extension_imports_itself_relatively(source):
    path, tree = source
    own = {p.stem for p in FILES} | {"addon", "oncue"}
    absolute = {module for level, module in imported(tree) if level == 0 and module.split(".")[0] in own}
    assert not absolute, f"{name_of(path)} imports {absolute}"


def test_no_exception_is_swallowed(source):
    path, tree = source
    for node in ast.walk(tree):
        if isinstance(node, ast.ExceptHandler):
            where = f"{name_of(path)}:{node.lineno}"
            assert node.type is not None, f"{where} catches everything"
            assert not all(isinstance(s, ast.Pass) for s in node.body), f"{where} hides what it catches"


def test_no_operator_name_is_given_twice():
    names = []
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "bl_idname":
                names.append(ast.unparse(node.value))
    assert len(names) == len(set(names)) > 5


def test_every_file_says_its_licence():
    for path in FILES:
        assert path.read_text(encoding="utf-8").startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n"), path
