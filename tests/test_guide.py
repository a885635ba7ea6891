"""The artist's guide holds together: its pictures, buttons, settings, scenes and messages are those that there are."""

import ast
import importlib
import json
import re
import sys
from pathlib import Path
from struct import unpack

import pytest

ROOT = Path(__file__).parents[1]
GUIDE, ADDON, CORE = ROOT / "docs" / "guide", ROOT / "addon", ROOT / "rust" / "oncue" / "src"
PAGES = sorted(path for path in GUIDE.glob("*.md") if path.name != "README.md")
PICTURES = sorted((GUIDE / "pictures").iterdir())
#: The most that one picture and all of them may take, bytes, and the most lines of a page.
PICTURE_BYTES, ALL_BYTES, LINES = 150_000, 1_500_000, 90
#: `[text](target)` and `![text](target)`.
LINK = re.compile(r"(!?)\[[^\]]*\]\(([^)\s]+)\)")
#: A button, a setting or another word of Oncue's interface.
BOLD = re.compile(r"\*\*([^*]+)\*\*")
#: A name or a number within a sentence, as the add-on's templates, the core's, and German have it.
VALUE = re.compile(r"\{[^{}]*\}")
#: A template that says less itself fits anything, letters; and less than a third of the sentence, unless it says much.
SAYS, SAYS_MUCH = 12, 30


def text_of(path):
    return path.read_text(encoding="utf-8")


def stem(path):
    return path.stem


# --- pages and pictures -----------------------------------------------------------------------------------------------


def test_there_are_ten_pages_and_the_first_lists_them():
    listed = [target for _, target in LINK.findall(text_of(GUIDE / "README.md"))]
    assert len(PAGES) == 10
    assert {page.name for page in PAGES} <= set(listed)
    assert "docs/guide/README.md" in text_of(ROOT / "README.md")


@pytest.mark.parametrize("page", PAGES, ids=stem)
def test_a_page_is_short_and_has_a_picture_or_three(page):
    text = text_of(page)
    assert len(text.splitlines()) <= LINES
    assert 1 <= len(re.findall(r"!\[", text)) <= 3


def test_each_picture_is_shown_and_small():
    shown = {GUIDE / target for page in PAGES for mark, target in LINK.findall(text_of(page)) if mark}
    assert shown == set(PICTURES)
    sizes = {picture.name: picture.stat().st_size for picture in PICTURES}
    assert max(sizes.values()) <= PICTURE_BYTES, sizes
    assert sum(sizes.values()) <= ALL_BYTES
    for picture in PICTURES:
        # Indexed: colour type 3 of the header.
        assert unpack(">B", picture.read_bytes()[25:26]) == (3,), picture.name


def test_the_script_makes_each_picture():
    driver, inside = (text_of(ROOT / "tools" / name) for name in ("guide_pictures.py", "guide_in_blender.py"))
    for picture in PICTURES:
        assert f'"{picture.stem}"' in driver, picture.name
    windows = driver[driver.index("WINDOWS") : driver.index("DRAWN =")]
    set_up = inside[inside.index("PICTURES: ") : inside.index("SCROLLED")]
    assert re.findall(r'Shot\("([\w-]+)"', windows) == re.findall(r'^    "([\w-]+)": ', set_up, re.MULTILINE)


def place_of(title):
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


@pytest.mark.parametrize("page", [GUIDE / "README.md", *PAGES], ids=stem)
def test_places_that_are_linked_exist(page):
    for _, target in LINK.findall(text_of(page)):
        file, _, place = target.partition("#")
        if place:
            titles = re.findall(r"^#+ (.*)", text_of(page.parent / file), re.MULTILINE)
            assert place in map(place_of, titles), target


# --- the extension ----------------------------------------------------------------------------------------------------


def catalogue():
    """Every word of the interface: what other languages have words for."""
    return json.loads(text_of(ADDON / "languages" / "de.json"))


@pytest.mark.parametrize("page", [GUIDE / "README.md", *PAGES], ids=stem)
def test_buttons_and_settings_that_are_named_exist(page):
    words = catalogue()
    assert [name for name in BOLD.findall(text_of(page)) if name not in {*words, "Oncue", "Rigify"}] == []


def settings():
    """Name → label of each setting of a scene and of the preferences."""
    found = {}
    for file, name in (("properties.py", "OncueSettings"), ("preferences.py", "OncuePreferences")):
        tree = ast.parse(text_of(ADDON / file))
        (made,) = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name)
        for line in made.body:
            if not isinstance(line, ast.AnnAssign):
                continue
            given = {word.arg: word.value for word in line.annotation.keywords}
            label = given.get("name")
            if label is not None and "HIDDEN" not in ast.unparse(given.get("options", ast.Constant(""))):
                found[line.target.id] = label.value
    return found


def test_the_page_of_settings_has_each_of_them():
    told = set(BOLD.findall(text_of(GUIDE / "settings.md")))
    found = settings()
    assert len(found) > 20
    # The list's chosen row is no setting that anybody sets.
    assert {label for name, label in found.items() if name != "library_index"} - told == set()


def manual():
    """(place, what it is called, page of the guide) of each entry of the manual."""
    entries = re.findall(r'<dt id="(\w+)">(.*?)</dt>', text_of(ADDON / "manual.html"))
    page = re.compile(r'href="guide/([\w-]+)\.html"')
    return [(place, re.sub(r" ?<a .*</a>", "", said), page.findall(said)) for place, said in entries]


def test_each_entry_of_the_manual_leads_to_the_page_that_tells_of_it():
    words = catalogue()
    for place, said, pages in manual():
        assert len(pages) == 1, place
        page = GUIDE / f"{pages[0]}.md"
        assert page in PAGES, place
        # What has no button with its name is told of in other words.
        names = [name for name in said.split(", ") if name in words and name != "The cue's name"]
        told = set(BOLD.findall(text_of(page)))
        assert not names or told.intersection(names), f"{page.name} does not tell of {said}"


def test_each_panel_leads_to_a_page():
    asked = re.findall(r'^    guide = "([\w-]+)"', text_of(ADDON / "panels.py"), re.MULTILINE)
    assert len(asked) == 7
    assert {GUIDE / f"{name}.md" for name in asked} <= set(PAGES)


@pytest.mark.parametrize("page", [GUIDE / "README.md", *PAGES], ids=stem)
def test_verbs_files_and_options_that_are_named_exist(page):
    text = text_of(page)
    verbs = set(re.findall(r"nox -s (\w+)", text))
    assert verbs <= set(re.findall(r"@nox.session\ndef (\w+)", text_of(ROOT / "noxfile.py")))
    scenes = re.findall(r"`(?:out/examples/)?([\w-]+)\.blend`", text)
    examples = text_of(ROOT / "blend_fixtures" / "examples.py")
    for scene in set(scenes) - {"scene", "out"}:
        assert f'"{scene}": ' in examples, scene
    if page.stem == "batch":
        options = set(re.findall(r'add_argument\(\s*"(--[\w-]+)"', text_of(ADDON / "command_line.py")))
        told = set(re.findall(r"`(--[\w-]+)`", text)) - {"--python-exit-code"}
        assert told == options - {"--out", "--report"}


# --- messages ---------------------------------------------------------------------------------------------------------


def templates():
    """Each sentence that the extension and the core can say, {} for names and numbers."""
    found = set()
    for file in ADDON.rglob("*.py"):
        for node in ast.walk(ast.parse(text_of(file))):
            if isinstance(node, ast.JoinedStr):
                found.add("".join(p.value if isinstance(p, ast.Constant) else "{}" for p in node.values))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(VALUE.sub("{}", node.value))
    for file in CORE.rglob("*.rs"):
        for literal in re.findall(r'"((?:[^"\\]|\\.)*)"', without_tests(file), re.DOTALL):
            found.add(VALUE.sub("{}", re.sub(r"\\\n\s*", "", literal).replace('\\"', '"')))
    return {template for template in found if len(template.replace("{}", "")) >= SAYS and " " in template}


def without_tests(file):
    """A source of the core's; what its tests expect is said by nobody."""
    return text_of(file).partition("#[cfg(test)]")[0]


def pattern_of(template):
    return re.compile("(.*?)".join(map(re.escape, template.split("{}"))), re.DOTALL)


@pytest.fixture(scope="module")
def fits():
    """Which template a sentence follows, the one that says most; None where nobody says it."""
    patterns = sorted(templates(), key=lambda template: -len(template.replace("{}", "")))
    patterns = [(template, pattern_of(template)) for template in patterns]

    def find(sentence):
        # Blender's side knows the object of a place that the core names by its numbers.
        sentence = re.sub(r"deep in ‘[^’]+’", "deep in what stands at 0.00, 0.00, 0.00", sentence)
        # Who it is said of comes before what is said of the character's state.
        rest = re.sub(r"^\S+ ", "", sentence)
        whole = [sentence, sentence.rstrip("."), rest, rest.rstrip(".")]
        for template, pattern in patterns:
            said = len(template.replace("{}", ""))
            if any(pattern.fullmatch(one) for one in whole) and said >= min(len(sentence) / 3, SAYS_MUCH):
                return template
        return None

    return find


def quoted():
    """The messages of the page, each the first cell of a row."""
    rows = re.findall(r"^\| (.+?) \| .+ \|$", text_of(GUIDE / "troubleshooting.md"), re.MULTILINE)
    return [row for row in rows if row != "it says"]


def test_each_message_that_is_quoted_can_be_said(fits):
    assert len(quoted()) > 35
    assert [message for message in quoted() if fits(message) is None] == []


def test_a_sentence_that_nobody_says_is_found_out(fits):
    assert fits("Start ‘Start’ stands in the rain; bring it home.") is None
    assert fits("There is no Stop cue: place one where the character begins (Oncue tab, Start).") is None


def test_what_is_refused_in_the_situations_is_on_the_page(fits):
    """docs/situations.md is made of what the program says of scenes as artists have them."""
    scenes = text_of(ROOT / "docs" / "situations.md").partition("## Captures")[0]
    outcomes = re.findall(r"^\| .+? \| (.+) \|$", scenes, re.MULTILINE)[2:]
    refusals = [said for said in outcomes if not said.startswith("can be done")]
    notes = [note for said in outcomes if said.startswith("can be done; ") for note in said.split("; ", 1)[1:]]
    told = {fits(message) for message in quoted()}
    assert len(refusals) > 20
    assert len(notes) >= 3
    for said in refusals:
        assert fits(said) in told, said


@pytest.mark.parametrize(
    ("file", "among"),
    [
        # What is said of a motion that a person would not accept.
        ("figures/problems.rs", r"The \{\} is"),
        # What the core says where no motion was found, or it missed a cue.
        ("synthesize.rs", r"(No motion|The character|Cue ')"),
    ],
)
def test_what_is_said_of_a_motion_is_on_the_page(fits, file, among):
    literals = re.findall(r'"((?:[^"\\]|\\.)*)"', without_tests(CORE / file), re.DOTALL)
    said = {VALUE.sub("{}", re.sub(r"\\\n\s*", "", literal)) for literal in literals}
    said = {template for template in said if re.match(among, template)}
    assert len(said) >= 3
    assert said - {fits(message) for message in quoted()} == set()


# --- as HTML ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The guide as it lies in the archive, with the manual beside it."""
    sys.path.insert(0, str(ROOT / "tools"))
    folder = tmp_path_factory.mktemp("extension")
    written = importlib.import_module("guide_pages").write_pages(folder / "guide")
    (folder / "manual.html").write_text(text_of(ADDON / "manual.html"), encoding="utf-8")
    return [*written, folder / "manual.html"]


def test_every_link_of_the_pages_leads_somewhere_without_a_network(pages):
    linked = set()
    for page in pages:
        for target in re.findall(r'(?:href|src)="([^"]*)"', text_of(page)):
            file, _, place = target.partition("#")
            if file.startswith("https:"):
                assert page.name.startswith("docs-"), f"{page.name} leads to {target}"
                continue
            path = page.parent / file if file else page
            assert path.is_file(), f"{page.name}: {target}"
            assert not place or f'id="{place}"' in text_of(path), f"{page.name}: {target}"
            linked.add(path.resolve())
    assert {page.resolve() for page in pages} <= linked


def test_no_sign_of_markdown_is_left_on_the_pages(pages):
    for page in pages[:-1]:
        shown = re.sub(r"<pre>.*?</pre>|<code>.*?</code>|<style>.*?</style>", "", text_of(page), flags=re.DOTALL)
        assert not re.search(r"\*\*|`|\]\(|^#", shown, re.MULTILINE), page.name
        assert shown.count("<table>") == shown.count("</table>")


def test_what_is_no_markup_is_shown_as_it_is(pages):
    convert = importlib.import_module("guide_pages").body_of
    assert "a &lt; b &amp; c" in convert("a < b & c", GUIDE / "README.md")
    assert "<code>a*b*</code>" in convert("`a*b*`", GUIDE / "README.md")
