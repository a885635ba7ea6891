"""What is shown can be shown in other languages, and each button and setting has its place in the manual."""

import ast
import re
from pathlib import Path

import bpy
import pytest

ROOT = Path(__file__).parents[2]
ADDON = ROOT / "addon"
#: What the core is at, as it tells it.
STAGE = re.compile(r'\bstage\("([^"]+)"')
#: Calls whose first or second argument is shown to the artist as it is.
SAID = {"SceneError", "CharacterError", "ScaleError", "FollowingEnded", "say", "cannot", "stop"}


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


def template_of(node, constants=None):
    """A text of the source with {} for what is put in but constants of its file, or None for what is no text."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(
            part.value if isinstance(part, ast.Constant) else (constants or {}).get(getattr(part.value, "id", ""), "{}")
            for part in node.values
        )
    return None


def nodes():
    """Every node of the extension's source, with its file and the texts that its file has names for."""
    for file in sorted(ADDON.rglob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        named = [(node.targets[0], template_of(node.value)) for node in tree.body if isinstance(node, ast.Assign)]
        constants = {target.id: text for target, text in named if text and isinstance(target, ast.Name)}
        for node in ast.walk(tree):
            yield file, node, constants


def said_in_full():
    """The sentences that the source says in one piece, by where they are said."""
    for file, node, constants in nodes():
        # What is said on a terminal alone is English.
        if file.name == "command_line.py" or not isinstance(node, ast.Call):
            continue
        if getattr(node.func, "id", getattr(node.func, "attr", "")) in SAID:
            for argument in node.args[:2]:
                text = template_of(argument, constants)
                # All of it a value: said elsewhere.
                if text and " " in re.sub(r"\{\}[.: ]*", "", text).strip():
                    yield file.name, text


@pytest.fixture
def german(oncue, monkeypatch):
    """Has Oncue speak German, as a Blender does that knows other languages."""
    catalogue = {english: said for (_, english), said in oncue("translations").messages()["de"].items()}
    speaker = oncue("sentences").speaker
    speaker.learn(catalogue, lambda text: catalogue.get(text, text))
    yield catalogue
    speaker.learn(catalogue, bpy.app.translations.pgettext_iface)


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
        source = " ".join(filter(None, (template_of(node, constants) for _, node, constants in nodes())))
        source += " ".join(" ".join(STAGE.findall(file.read_text(encoding="utf-8"))) for file in core_files())
        stale = [text for text in there - shown if longest_part(text) not in source]
        assert stale == [], language
        assert all(said.strip() for said in catalogue.values())


def core_files():
    return [*(ROOT / "rust").glob("oncue/src/**/*.rs"), *(ROOT / "rust").glob("oncue-python/src/**/*.rs")]


def longest_part(template):
    """The beginning of the longest piece that a template says itself."""
    return max(template.split("{}"), key=len).strip(" .,:;()")[:24]


def test_every_stage_of_a_run_has_a_name_in_every_language(oncue):
    stages = {stage for file in core_files() for stage in STAGE.findall(file.read_text(encoding="utf-8"))}
    titles = {
        node.value.value
        for _, node, _ in nodes()
        if isinstance(node, ast.Assign)
        and getattr(node.targets[0], "id", "") == "title"
        and isinstance(node.value, ast.Constant)
    }
    assert len(stages) > 15
    assert len(titles) > 4
    for language, catalogue in oncue("translations").messages().items():
        lacking = (stages | titles | {"Starting", "Stopping"}) - {english for _, english in catalogue}
        assert lacking == set(), language


def test_every_sentence_that_is_said_in_one_piece_can_be_said_in_german(oncue, german):
    told, lacking = oncue("sentences").told, []
    for file, text in said_in_full():
        parts = text.split("{}")
        sentence = "".join(part + f"Thing {k}" * (k + 1 < len(parts)) for k, part in enumerate(parts))
        said = told(sentence)
        if said == sentence or any(f"Thing {k}" not in said for k in range(len(parts) - 1)):
            lacking.append((file, text))
    assert lacking == []


def test_a_language_has_room_for_every_name_and_number(oncue):
    for catalogue in oncue("translations").messages().values():
        for (_, english), said in catalogue.items():
            values = [f"<{k}>" for k in range(english.count("{}"))]
            if values:
                assert all(value in said.format(*values) for value in values), english


@pytest.mark.parametrize(
    ("english", "german_words"),
    [
        ("Frames 3 to 40 were adapted.", "Die Bilder 3 bis 40 wurden angepasst."),
        # Names that look like words of a sentence stay.
        ("Oncue made the action Sit on Frames 3 to 4.", "Oncue hat die Action Sit on Frames 3 to 4 gemacht."),
        ("Nobody has ever said this.", "Nobody has ever said this."),
        # A sentence within another.
        (
            "Person is in edit mode, in which it shows no motion: leave edit mode (Tab); the motion is kept: press "
            "Write Motion once that is done.",
            "Person ist im Bearbeitungsmodus, in dem es keine Bewegung zeigt: den Bearbeitungsmodus verlassen (Tab); "
            "die Bewegung ist aufbewahrt: „Bewegung schreiben“ drücken, sobald das getan ist.",
        ),
    ],
)
def test_a_sentence_is_told_with_its_names(oncue, german, english, german_words):
    assert oncue("sentences").told(english) == german_words


def test_what_is_refused_is_told_in_german_and_reported_in_english(oncue, core, german):
    with pytest.raises(RuntimeError, match="Es gibt keine Startmarke: eine setzen"):
        bpy.ops.oncue.synthesize()
    # What is kept and what is logged is the same for everybody.
    assert "There is no Start cue" in oncue("job_operator").handle.message


def test_the_panel_tells_a_run_in_german(oncue, german):
    panels, pipeline = oncue("panels"), oncue("pipeline")
    told = oncue("sentences").told
    progress = pipeline.Progress("Optimizing", 0.5, 3, 1.0, 0.2, 12.0, 7.0)
    assert [told(line) for line, _ in panels.progress_lines(progress)] == [
        "12 s, noch etwa 7 s",
        "Durchgang 3, Erfolg 20 %, Belohnung 1.00",
    ]
    lines = panels._clipping_lines(
        {"percent": 0.0, "whole_body_percent": 16.7, "parts_percent": {"torso": 16.7, "leg": 2.0}}
    )
    assert panels.told_line(lines[1][0]) == "    irgendein Teil in 16.7 %, am meisten torso (16.7 %)"


def test_without_other_languages_everything_is_as_it_is(oncue):
    sentences = oncue("sentences")
    assert sentences.Speaker().told("Frames 3 to 40 were adapted.") == "Frames 3 to 40 were adapted."


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
