"""`write_page`: tables and figures as Markdown and as one self-contained HTML page."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ssiam.evaluation.paper.cells import Table
from ssiam.evaluation.paper.figures import Figure
from ssiam.outputs import atomic_write, make_folder

PAGE: Final = "tables.html"
_TITLE: Final = "Tables and figures of stabilized tracking"
_STYLE: Final = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1c1c1c; background: #fff;
  max-width: 1240px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; } h2 { margin-top: 3rem; border-bottom: 1px solid #ccc; }
h3 { margin: 2rem 0 .5rem; font-size: 1.05rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .5rem; border-bottom: 1px solid #ddd; text-align: left;
  white-space: nowrap; }
th { border-bottom: 2px solid #888; } .number { text-align: right; }
tbody tr:nth-child(even) { background: #f6f6f6; }
.notes, figcaption { color: #555; font-size: .85rem; } figure { margin: 1rem 0; }
img { max-width: 100%; height: auto; }
"""


@dataclass(frozen=True)
class Section:
    """Tables and figures of one dataset.

    Attributes
    ----------
    title : str
    tables : sequence of Table
    figures : sequence of Figure
    notes : sequence of str
        A line for each missing result or figure.
    """

    title: str
    tables: Sequence[Table]
    figures: Sequence[Figure] = ()
    notes: Sequence[str] = ()


def write_page(
    folder: Path, sections: Sequence[Section], explanation: str, *, title: str = _TITLE
) -> list[Path]:
    """Write ``tables.md``, ``tables.html`` and a PNG for each figure.

    Returns
    -------
    list of Path
        The written files.

    Raises
    ------
    SinkError
        One of them cannot be written.
    """
    files = {
        "tables.md": markdown(sections, explanation, title).encode(),
        PAGE: page(sections, explanation, title).encode(),
        **{f"{each.name}.png": each.png for section in sections for each in section.figures},
    }
    make_folder(folder)
    for name, data in files.items():
        with atomic_write(folder / name, "wb", hidden=True) as file:
            file.write(data)
    return [folder / name for name in files]


def markdown(sections: Sequence[Section], explanation: str, title: str = _TITLE) -> str:
    """All sections as Markdown with aligned columns; figures are links to PNG files."""
    parts = [f"# {title}", explanation]
    for section in sections:
        parts.append(f"## {section.title}")
        parts += [markdown_table(each) for each in section.tables]
        parts += [
            f"### {each.title}\n\n![{each.title}](<{each.name}.png>)\n\n{each.caption}"
            for each in section.figures
        ]
        parts += [f"### Missing\n\n{_bullets(section.notes)}"] if section.notes else []
    return "\n\n".join(parts) + "\n"


def markdown_table(table: Table) -> str:
    """A table as Markdown, with its title and notes."""
    cells = [[cell.replace("|", "\\|") for cell in row] for row in (table.head, *table.rows)]
    widths = [max(3, *map(len, column)) for column in zip(*cells, strict=True)]
    right = _numeric(table)
    lines = ["| " + " | ".join(map(_padded, row, widths, right)) + " |" for row in cells]
    rules = (
        "-" * (width - 1) + (":" if is_right else "-")
        for width, is_right in zip(widths, right, strict=True)
    )
    lines.insert(1, "| " + " | ".join(rules) + " |")
    below = [_bullets(table.notes)] if table.notes else []
    return "\n\n".join([f"### {table.title}", "\n".join(lines), *below])


def page(sections: Sequence[Section], explanation: str, title: str = _TITLE) -> str:
    """All sections as one HTML page with embedded figures and style."""
    body = [f"<h1>{html.escape(title)}</h1>", f"<p>{html.escape(explanation)}</p>"]
    for section in sections:
        body.append(f"<h2>{html.escape(section.title)}</h2>")
        body += [_html_table(each) for each in section.tables]
        body += [_html_figure(each) for each in section.figures]
        body += [f"<h3>Missing</h3>{_html_notes(section.notes)}"] if section.notes else []
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def _html_table(table: Table) -> str:
    right = _numeric(table)
    head = "".join(map(_html_cell, ["th"] * len(right), table.head, right))
    rows = ("".join(map(_html_cell, ["td"] * len(right), row, right)) for row in table.rows)
    body = "\n".join(f"<tr>{row}</tr>" for row in rows)
    return (
        f'<h3>{html.escape(table.title)}</h3>\n<div class="wide"><table>\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>\n"
        + _html_notes(table.notes)
    )


def _html_cell(tag: str, text: str, is_right: bool) -> str:
    kind = ' class="number"' if is_right else ""
    return f"<{tag}{kind}>{html.escape(text)}</{tag}>"


def _html_figure(figure: Figure) -> str:
    data = base64.b64encode(figure.png).decode()
    title = html.escape(figure.title)
    return (
        f'<h3>{title}</h3>\n<figure><img alt="{title}" src="data:image/png;base64,{data}">'
        f"<figcaption>{html.escape(figure.caption)}</figcaption></figure>"
    )


def _html_notes(notes: Sequence[str]) -> str:
    items = "".join(f"<li>{html.escape(note)}</li>" for note in notes)
    return f'<ul class="notes">{items}</ul>' if notes else ""


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _numeric(table: Table) -> list[bool]:
    """Which columns contain only numbers, signed or not, and empty cells."""
    columns = zip(*table.rows, strict=True) if table.rows else [("x",)] * len(table.head)
    return [all(re.fullmatch(r"[+-]?[\d.]*", cell) for cell in each) for each in columns]


def _padded(text: str, width: int, is_right: bool) -> str:
    return text.rjust(width) if is_right else text.ljust(width)
