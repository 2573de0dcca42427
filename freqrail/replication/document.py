"""A report as blocks, written twice: as Markdown beside its figures, and as one HTML file that holds them.

Text may mark **strong** words, `code` and [link](#anchor) or [link](file); nothing else is interpreted.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Heading:
    """A heading of level 1 to 3."""

    level: int
    text: str


@dataclass(frozen=True)
class Paragraph:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of items."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """A table; every row as long as `head`. marks: words whose cells get a colour, with its name."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Image:
    """A figure: stem of its files (SVG and PNG), title and caption."""

    stem: str
    title: str
    caption: str


Block = Heading | Paragraph | Bullets | Table | Image


def markdown(blocks: Sequence[Block]) -> str:
    """The blocks as Markdown; images are the SVG files beside it."""
    return "\n\n".join(_markdown(block) for block in blocks) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading(level, text):
            return f"{'#' * level} {text}"
        case Paragraph(text):
            return text
        case Bullets(items):
            return "\n".join(f"- {item}" for item in items)
        case Table(head, rows):
            lines = [head, ["---"] * len(head), *rows]
            return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)
        case Image(stem, title, caption):
            return f"![{title}]({stem}.svg)\n\n**{title}.** {caption}"


def web_page(blocks: Sequence[Block], folder: Path) -> str:
    """The blocks as one HTML file, the SVG files of `folder` in it as data; readable on a narrow screen."""
    title = next(block.text for block in blocks if isinstance(block, Heading))
    body = "\n".join(_html(block, folder) for block in blocks)
    return _PAGE.format(title=html.escape(title), style=_STYLE, body=body)


def _html(block: Block, folder: Path) -> str:
    match block:
        case Heading(level, text):
            return f'<h{level} id="{anchor(text)}">{_inline(text)}</h{level}>'
        case Paragraph(text):
            return f"<p>{_inline(text)}</p>"
        case Bullets(items):
            return "<ul>\n" + "\n".join(f"<li>{_inline(item)}</li>" for item in items) + "\n</ul>"
        case Table(head, rows):
            cells = "".join(f"<th>{_inline(cell)}</th>" for cell in head)
            lines = "\n".join(
                f"<tr>{''.join(_cell(h, c) for h, c in zip(head, row, strict=True))}</tr>" for row in rows
            )
            return f"<table>\n<thead><tr>{cells}</tr></thead>\n<tbody>\n{lines}\n</tbody>\n</table>"
        case Image(stem, title, caption):
            data = base64.b64encode((folder / f"{stem}.svg").read_bytes()).decode()
            source = f"data:image/svg+xml;base64,{data}"
            picture = f'<div class="wide"><img alt="{html.escape(title)}" src="{source}"></div>'
            return (
                f'<figure id="{stem}">{picture}'
                f"<figcaption><strong>{_inline(title)}.</strong> {_inline(caption)}</figcaption></figure>"
            )


def _cell(head: str, text: str) -> str:
    """A cell that says what it is, for narrow screens, where rows are stacked."""
    kind = re.sub(r"\W+", "-", re.sub(r"\*", "", text.lower())).strip("-")
    return (
        f'<td data-head="{html.escape(head)}" class="is-{kind}">{_inline(text)}</td>'
        if len(kind) < 20
        else (f'<td data-head="{html.escape(head)}">{_inline(text)}</td>')
    )


def anchor(text: str) -> str:
    """What a heading is linked to by."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def _inline(text: str) -> str:
    text = html.escape(text)
    text = re.sub(r"(?<=\d) (?=(?:%|[kMG]?N/m|km/h|Hz|m?s)(?![\w²]))", "&nbsp;", text)  # a number stays with its unit
    text = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", text)
    text = re.sub(r"`(.+?)`", r"<code>\1</code>", text)
    return re.sub(r"\[([^\]]+)\]\(([^)]+)\)", r'<a href="\2">\1</a>', text)


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""

_STYLE = """
body { margin: 0; font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; }
main { max-width: 84rem; margin: 0 auto; padding: 1rem; } p, ul, figure { max-width: 62rem; }
h1 { font-size: 1.6rem; line-height: 1.25; } h2 { font-size: 1.3rem; margin-top: 2.2rem; } h3 { font-size: 1.1rem; }
code { font-size: .9em; background: #f2f2f2; padding: 0 .2em; overflow-wrap: anywhere; }
table { border-collapse: collapse; width: 100%; font-size: .875rem; margin: 1rem 0; }
th, td { text-align: left; vertical-align: top; padding: .35rem .5rem; border-bottom: 1px solid #ddd; }
td:first-child { white-space: nowrap; }
th { border-bottom: 2px solid #888; }
td.is-holds { color: #00613f; font-weight: 600; } td.is-holds-partly { color: #7a5200; font-weight: 600; }
td.is-does-not-hold { color: #a3260f; font-weight: 600; }
figure { margin: 1.5rem 0; } figcaption { font-size: .875rem; color: #444; }
.wide { overflow-x: auto; } .wide img { width: 100%; min-width: 640px; max-width: 900px; display: block; }
@media (max-width: 44rem) {
  thead { display: none; }
  tr { display: block; padding: .5rem 0; border-bottom: 2px solid #bbb; }
  td, td:first-child { white-space: normal; }
  td { display: block; border: 0; padding: .1rem 0; overflow-wrap: anywhere; }
  td:empty { display: none; }
  td::before { content: attr(data-head) ": "; color: #666; font-weight: 400; }
}
@media print { .wide img { min-width: 0; } }
"""
