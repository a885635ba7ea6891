"""What is shown can be shown in other languages, and each button and setting has its place in the manual."""

import ast
import re
from pathlib import Path

import bpy
import pytest

ADDON = Path(__file__).parents[2] / "addon"


class Layout:
    """Notes what a menu shows."""

    operator_context = ""

    def __init__(self):
        self.shown = []

    def operator(self, _name, *, text="", **_):
        self.shown.append(text)
        return type("Properties", (), {})()

    def separator(self):
        pass


def of_properties(rna):
    """Names and descriptions of what can be set, and of what can be chosen."""
    for part in rna.properties:
        if part.identifier in ("rna_type", "name", "bl_idname") or part.is_hidden:
            continue
        yield from (part.name if part.name != part.identifier else "", part.description)
        if part.type == "ENUM":
            for item in part.enum_items:
                yield from (item.name, item.description)


def literals(file):
    """What the source has a layout show word for word."""
    for node in ast.walk(ast.parse((ADDON / file).read_text(encoding="utf-8"))):
        if (
            isinstance(node, ast.keyword)
            and node.arg in ("text", "placeholder")
            and isinstance(node.value, ast.Constant)
        ):
            yield node.value.value


@pytest.fixture
def shown(oncue):
    """All that Oncue's buttons, settings, tooltips, panels and menus show, but for what depends on a scene."""
    found = []
    for name in dir(bpy.ops.oncue):
        operator = getattr(bpy.ops.oncue, name).get_rna_type()
        found += [operator.name, operator.description, *of_properties(operator)]
    found += of_properties(bpy.types.Scene.bl_rna.properties["oncue"].fixed_type)
    found += of_properties(oncue("preferences").OncuePreferences.bl_rna)
    for name, note in oncue("properties").PRESET_NOTES.items():
        found += [name.title(), note]
    menus = oncue("operators.menus")
    for cls in (*oncue("panels").CLASSES, *menus.CLASSES):
        found.append(getattr(cls, "bl_label", ""))
    for menu in menus.CLASSES:
        layout = Layout()
        menu.draw(type("Menu", (), {"layout": layout})(), bpy.context)
        found += layout.shown
    for file in ("panels.py", "preferences.py"):
        found += literals(file)
    found += ["Centimetres", "Millimetres", "Metres"]
    return {text for text in found if text}


def test_every_language_says_all_of_it_and_nothing_else(oncue, shown):
    catalogues = oncue("translations").messages()
    assert catalogues
    for language, catalogue in catalogues.items():
        there = {english for _, english in catalogue}
        assert shown - there == set(), language
        assert there - shown == set(), language
        assert all(said.strip() for said in catalogue.values())


@pytest.mark.skipif(not bpy.app.build_options.international, reason="this Blender speaks English alone")
def test_a_tooltip_is_told_in_the_language_of_the_interface(oncue):
    """Blender's own words come first: what only Oncue says is looked up here."""
    view = bpy.context.preferences.view
    before = view.language
    german = next(item for item in ("de", "de_DE") if item in bpy.app.translations.locales)
    text = "Train Manifold"
    assert bpy.app.translations.pgettext(text, "Operator") == text
    try:
        view.language = german
        assert bpy.app.translations.pgettext(text, "Operator") == "Mannigfaltigkeit trainieren"
        assert bpy.app.translations.pgettext_iface("Feet and Hands") == "Füße und Hände"
    finally:
        view.language = before


def test_everything_has_its_place_in_the_manual(oncue):
    places = {suffix.lstrip("#") for _, suffix in oncue("manual").manual_map()[1]}
    settings = bpy.types.Scene.bl_rna.properties["oncue"].fixed_type
    own = {part.identifier for part in settings.properties if not part.is_hidden}
    assert places == set(dir(bpy.ops.oncue)) | own - {"rna_type", "name"}
    page = oncue("manual").PAGE.read_text(encoding="utf-8")
    assert len(re.findall(r'id="\w+"', page)) == len(places), "none comes twice"


@pytest.mark.parametrize(("name", "place"), [("bpy.ops.oncue.pin", "#pin"), ("bpy.types.OncueSettings.seed", "#seed")])
def test_blender_finds_the_page(oncue, name, place):
    """As *Online Manual* in a context menu asks for it."""
    find = bpy.types.WM_OT_doc_view_manual._lookup_rna_url
    url = find(name, verbose=False)
    assert url == oncue("manual").PAGE.as_uri() + place
    assert Path(oncue("manual").PAGE).is_file()


def test_without_oncue_nothing_is_left(oncue):
    maps = len(bpy.utils._manual_map)
    oncue.package.unregister()
    try:
        assert len(bpy.utils._manual_map) == maps - 1
    finally:
        oncue.package.register()
    assert len(bpy.utils._manual_map) == maps
