"""The page: aligned columns, no external resources, escaped text."""

import base64
import os
import re

import pytest

from ssiam.errors import SinkError
from ssiam.evaluation.paper.cells import Table
from ssiam.evaluation.paper.figures import Figure
from ssiam.evaluation.paper.page import Section, markdown, markdown_table, page, write_page

TABLE = Table("A <b> table", ("name", "n"), [("a|b", "-1.5"), ("<i>", ""), ("c", "+22")], ["a & b"])


def test_markdown_columns_are_aligned():
    lines = [line for line in markdown_table(TABLE).splitlines() if line.startswith("|")]
    assert len(lines) == 5
    assert len({len(line) for line in lines}) == 1
    assert lines[1] == "| ---- | ---: |"
    assert "a\\|b" in lines[2]


def test_the_page_is_self_contained_and_escaped():
    text = page([Section("S & T", [TABLE], notes=["<missing>"])], "x < y")
    assert not re.search(r"(src|href)=.?http", text)
    assert "<i>" not in text
    for escaped in ("&lt;i&gt;", "S &amp; T", "&lt;missing&gt;", "x &lt; y"):
        assert escaped in text
    assert markdown([Section("S", [TABLE], notes=["missing"])], "x").endswith("- missing\n")


def test_a_table_of_the_page_has_nothing_but_its_rows():
    text = page([Section("S", [TABLE])], "x")
    table = text[text.index("<table") : text.index("</table>")]
    assert table.count("<tr>") == 1 + len(TABLE.rows)
    between = re.findall(r"</tr>(.*?)<tr>", table, re.DOTALL)
    assert all(not re.sub(r"</?t(head|body)>", "", part).strip() for part in between)


def test_the_written_page_has_a_title(tmp_path):
    write_page(tmp_path, [Section("S", [TABLE])], "x")
    text = (tmp_path / "tables.html").read_text(encoding="utf-8")
    assert "<title>Tables and figures of stabilized tracking" in text


def test_an_unwritable_folder_is_an_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SinkError, match=r"file.*cannot be written"):
        write_page(tmp_path / "file" / "out", [], "")


PLAIN = Table("Plain", ("name", "n"), [("a", "-1.5"), ("bcde", "2")], ["one", "two"])
FIGURE = Figure("fig1-d", "A & B", "See <this>.", b"\x89PNG data")


def test_a_table_in_markdown():
    assert markdown_table(PLAIN) == (
        "### Plain\n\n"
        "| name |    n |\n"
        "| ---- | ---: |\n"
        "| a    | -1.5 |\n"
        "| bcde |    2 |\n\n"
        "- one\n- two"
    )
    short = Table("Short", ("a",), [])
    assert markdown_table(short) == "### Short\n\n| a   |\n| --- |"


def test_a_page_in_markdown():
    sections = [
        Section("One", [PLAIN], [FIGURE], ["x", "y"]),
        Section("Two", [Table("Short", ("a",), [])]),
    ]
    assert markdown(sections, "Explained.") == (
        "# Tables and figures of stabilized tracking\n\nExplained.\n\n"
        f"## One\n\n{markdown_table(PLAIN)}\n\n"
        "### A & B\n\n![A & B](<fig1-d.png>)\n\nSee <this>.\n\n"
        "### Missing\n\n- x\n- y\n\n"
        "## Two\n\n### Short\n\n| a   |\n| --- |\n"
    )


def test_a_page_in_html():
    text = page([Section("One", [PLAIN], [FIGURE], ["x", "y"])], "Explained.")
    assert text.startswith('<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n')
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">\n' in text
    title = "Tables and figures of stabilized tracking"
    assert f"<title>{title}</title>\n<style>\nbody {{" in text
    image = base64.b64encode(FIGURE.png).decode()
    assert text.partition("<body>")[2] == (
        f"\n<h1>{title}</h1>\n<p>Explained.</p>\n<h2>One</h2>\n"
        '<h3>Plain</h3>\n<div class="wide"><table>\n'
        '<thead><tr><th>name</th><th class="number">n</th></tr></thead>\n<tbody>\n'
        '<tr><td>a</td><td class="number">-1.5</td></tr>\n'
        '<tr><td>bcde</td><td class="number">2</td></tr>\n'
        "</tbody></table></div>\n"
        '<ul class="notes"><li>one</li><li>two</li></ul>\n'
        f'<h3>A &amp; B</h3>\n<figure><img alt="A &amp; B" src="data:image/png;base64,{image}">'
        "<figcaption>See &lt;this&gt;.</figcaption></figure>\n"
        '<h3>Missing</h3><ul class="notes"><li>x</li><li>y</li></ul>\n'
        "</body>\n</html>\n"
    )


def test_sections_without_notes_and_tables_without_rows_have_no_lists():
    text = page([Section("One", [Table("Short", ("a",), [])])], "x")
    assert "Missing" not in text
    assert "<ul" not in text
    assert "<thead><tr><th>a</th></tr></thead>\n<tbody>\n\n</tbody>" in text


@pytest.mark.parametrize(
    ("cells", "right"),
    [
        (("1", "-2.5", "+.3", ""), True),
        (("1", "2 px"), False),
        (("x1",), False),
        (("1-2",), False),
    ],
)
def test_columns_of_numbers_are_aligned_to_the_right(cells, right):
    table = Table("t", ("n",), [(cell,) for cell in cells])
    assert ("-: |" in markdown_table(table)) == right
    assert ('<td class="number">' in page([Section("s", [table])], "")) == right


def test_the_written_files(tmp_path):
    sections = [Section("One", [PLAIN], [FIGURE])]
    files = write_page(tmp_path / "out", sections, "x")
    names = ["tables.md", "tables.html", "fig1-d.png"]
    assert files == [tmp_path / "out" / name for name in names]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(names)
    texts = [markdown(sections, "x").encode(), page(sections, "x").encode(), FIGURE.png]
    assert [path.read_bytes() for path in files] == texts


def test_unfinished_files_are_hidden(tmp_path, monkeypatch):
    seen = set()

    def look(handle):
        seen.update(path.name for path in tmp_path.iterdir() if path.name[0] != ".")

    monkeypatch.setattr(os, "fsync", look)
    write_page(tmp_path, [Section("One", [PLAIN], [FIGURE])], "x")
    assert seen <= {"tables.md", "tables.html", "fig1-d.png"}
