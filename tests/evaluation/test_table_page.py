"""The page: columns that stand, nothing from elsewhere, and nothing unescaped."""

import re

import pytest

from ssiam.errors import SinkError
from ssiam.evaluation.table_page import Section, markdown, markdown_table, page, write_page
from ssiam.evaluation.tables import Table

TABLE = Table("A <b> table", ("name", "n"), [("a|b", "1"), ("<i>", ""), ("c", "22")], ["a & b"])


def test_markdown_stands_in_columns():
    lines = [line for line in markdown_table(TABLE).splitlines() if line.startswith("|")]
    assert len(lines) == 5
    assert len({len(line) for line in lines}) == 1
    assert lines[1] == "| ---- | --: |"
    assert "a\\|b" in lines[2]


def test_the_page_needs_nothing_else_and_escapes_what_it_shows():
    text = page([Section("S & T", [TABLE], notes=["<gone>"])], "x < y")
    assert not re.search(r"(src|href)=.?http", text)
    assert "<i>" not in text
    for escaped in ("&lt;i&gt;", "S &amp; T", "&lt;gone&gt;", "x &lt; y"):
        assert escaped in text
    assert markdown([Section("S", [TABLE], notes=["gone"])], "x").endswith("- gone\n")


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SinkError, match=r"file.*cannot be written"):
        write_page(tmp_path / "file" / "out", [], "")
