"""docs/guide as pages of HTML that a browser shows without a network: they go into the extension's archive.

`python tools/guide_pages.py FOLDER` writes a page for each of docs/guide, and of the documents that those name, with
their pictures. It reads as much of Markdown as these documents use, and refuses what it does not know.
"""

from __future__ import annotations

import html
import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
GUIDE = DOCS / "guide"
#: The page that lists the others, and what it is called as HTML.
FIRST, INDEX = "README.md", "index.html"
#: Documents beside the guide that it names and that come along.
BESIDE = ("captures.md", "manifold.md", "report.md")
STYLE = """
body { font: 16px/1.5 sans-serif; max-width: 46em; margin: 2em auto; padding: 0 1em; }
img { max-width: 100%; } code { background: #eee; padding: 0 .2em; }
pre { background: #eee; padding: .6em; overflow: auto; } pre code { padding: 0; }
table { border-collapse: collapse; } td, th { border: 1px solid #ccc; padding: .2em .5em; text-align: left; }
nav { font-size: 14px; }
"""
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
#: How a line begins that is no running text.
SPECIAL = re.compile(r"#{1,4} |```|\||- |\d+\. |!\[")


def page_of(target: str, source: Path) -> str:
    """Where a link of the document `source` leads on the HTML pages; empty where its target does not come along."""
    if re.match(r"https?:|#", target):
        return target
    path, _, place = target.partition("#")
    file = (source.parent / path).resolve()
    known = {GUIDE / FIRST: INDEX, ROOT / "addon" / "manual.html": "../manual.html"}
    known |= {page: f"{page.stem}.html" for page in GUIDE.glob("*.md") if page.name != FIRST}
    known |= {DOCS / name: f"docs-{Path(name).stem}.html" for name in BESIDE}
    known |= {picture: f"pictures/{picture.name}" for picture in (GUIDE / "pictures").glob("*.png")}
    found = known.get(file, "")
    return f"{found}#{place}" if found and place else found


def inline(text: str, source: Path) -> str:
    """A line's text: code, links, pictures, bold and italics."""
    kept: list[str] = []

    def keep(made: str) -> str:
        kept.append(made)
        return f"\0{len(kept) - 1}\0"

    def link(match: re.Match[str]) -> str:
        picture, words, target = match.groups()
        where = page_of(html.unescape(target), source)
        if picture:
            return keep(f'<img src="{where}" alt="{words}">') if where else ""
        return keep(f'<a href="{where}">') + words + keep("</a>") if where else words

    text = re.sub(r"`([^`]+)`", lambda m: keep(f"<code>{html.escape(m[1], quote=False)}</code>"), text)
    text = LINK.sub(link, html.escape(text, quote=False))
    text = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", text)
    text = re.sub(r"(?<!\w)[*_]([^*_]+)[*_](?!\w)", r"<em>\1</em>", text)
    while "\0" in text:
        text = re.sub(r"\0(\d+)\0", lambda m: kept[int(m[1])], text)
    return text


def place_of(title: str) -> str:
    """The place of a title within its page, as GitHub has it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def body_of(text: str, source: Path) -> str:
    """The HTML of a document."""
    lines, out, k = text.split("\n"), [], 0

    def gathered(first: str) -> str:
        """The line that has begun, with those that go on with it."""
        nonlocal k
        words = [first]
        while k < len(lines) and lines[k].strip() and not SPECIAL.match(lines[k].lstrip()):
            words.append(lines[k].strip())
            k += 1
        return inline(" ".join(words), source)

    while k < len(lines):
        line = lines[k]
        k += 1
        if not line.strip():
            continue
        if line.startswith("```"):
            end = next(n for n in range(k, len(lines)) if lines[n].startswith("```"))
            out.append(f"<pre><code>{html.escape(chr(10).join(lines[k:end]))}</code></pre>")
            k = end + 1
        elif title := re.match(r"(#{1,4}) (.*)", line):
            level, words = len(title[1]), title[2]
            out.append(f'<h{level} id="{place_of(words)}">{inline(words, source)}</h{level}>')
        elif line.startswith("|"):
            k -= 1
            rows = []
            while k < len(lines) and lines[k].startswith("|"):
                rows.append([inline(cell.strip(), source) for cell in lines[k].strip().strip("|").split("|")])
                k += 1
            for number, row in enumerate(rows):
                rows[number] = [f"<{'td' if number else 'th'}>{cell}</{'td' if number else 'th'}>" for cell in row]
            # The second row is the rule under the first.
            cells = ["".join(row) for row in (rows[0], *rows[2:])]
            out.append("<table>" + "".join(f"<tr>{row}</tr>" for row in cells) + "</table>")
        elif item := re.match(r"(- |\d+\. )(.*)", line):
            kind = "ul" if item[1] == "- " else "ol"
            items = [gathered(item[2])]
            while k < len(lines) and (more := re.match(r"(- |\d+\. )(.*)", lines[k])):
                k += 1
                items.append(gathered(more[2]))
            out.append(f"<{kind}>" + "".join(f"<li>{one}</li>" for one in items) + f"</{kind}>")
        elif line.startswith((" ", ">")):
            raise SystemExit(f"{source.name}: this line is not understood: {line!r}")
        else:
            out.append(f"<p>{gathered(line)}</p>")
    return "\n".join(out)


def document(source: Path) -> str:
    """The HTML page of a document."""
    text = source.read_text(encoding="utf-8")
    title = text.partition("\n")[0].lstrip("# ")
    nav = f'<nav><a href="{INDEX}">Guide</a> · <a href="../manual.html">every button and setting</a></nav>'
    head = f'<meta charset="utf-8">\n<title>Oncue: {html.escape(title)}</title>\n<style>{STYLE}</style>'
    body = f"{nav}\n{body_of(text, source)}"
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def write_pages(folder: Path) -> list[Path]:
    """Writes all pages and their pictures into the folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    sources = [*sorted(GUIDE.glob("*.md")), *(DOCS / name for name in BESIDE)]
    pages = []
    for source in sources:
        page = folder / page_of(source.name, source)
        page.write_text(document(source), encoding="utf-8")
        pages.append(page)
    shutil.copytree(GUIDE / "pictures", folder / "pictures")
    return pages


if __name__ == "__main__":
    for written in write_pages(Path(sys.argv[1])):
        print(f"wrote {written}")
