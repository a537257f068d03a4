"""The page: aligned columns, no external resources, escaped text."""

import re

import pytest

from ssiam.errors import SinkError
from ssiam.evaluation.paper.cells import Table
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
