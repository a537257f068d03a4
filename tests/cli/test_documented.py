"""What the documentation says of result files and of the service agrees with the program."""

import configparser
import json
import re
import shlex
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from helpers.tracked_clip import BOX, box_of, rows_of
from ssiam.cli import main
from ssiam.cli.box_words import join_box_words
from ssiam.cli.boxes import BOX_COLUMNS, MOMENT_COLUMNS
from ssiam.cli.main import app

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"


def table_with(page, heading):
    """The rows of the page's table whose first cell of the header is `heading`."""
    lines = (HOW_TO / page).read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {heading} |"))
    rows = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            return rows
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_columns_of_results_are_documented_in_their_order(clip, tmp_path):
    documented = [
        name
        for cells in table_with("video.md", "column")
        for name in re.findall(r"`(\w+)`", cells[0])
    ]
    for name in ("r.csv", "r.jsonl"):
        arguments = ["--box", box_of(BOX), "--tracker", "kcf", "--end", "2"]
        results = ["--results", str(tmp_path / name)]
        assert main(["track", str(clip[0]), *arguments, *results]) == 0
    assert list(rows_of(tmp_path / "r.csv")[0]) == documented
    assert list(json.loads((tmp_path / "r.jsonl").read_text().splitlines()[0])) == documented


@pytest.mark.parametrize("layout", ["otb", "vot", "mot"])
def test_lines_of_text_layouts_are_as_documented(clip, tmp_path, layout):
    cells = {row[0].strip("`"): row for row in table_with("video.md", "layout of a `.txt`")}[layout]
    results = ["--results", str(tmp_path / "r.txt"), "--layout", layout]
    box = ["--box", f"2:{box_of(BOX)}", "--tracker", "kcf", "--end", "4"]
    assert main(["track", str(clip[0]), *box, *results]) == 0
    lines = (tmp_path / "r.txt").read_text().splitlines()
    form = re.match(r"`([^`]+)`", cells[1])[1]
    assert lines[-1].count(",") == form.count(",")
    waiting = cells[2].strip("`")
    assert lines[:2] == [waiting] * 2 if waiting != "no line" else lines[0].startswith("3,1,")


def test_columns_of_a_file_of_boxes_are_documented():
    text = (HOW_TO / "video.md").read_text()
    sentence = next(line for line in text.splitlines() if line.startswith("The columns of such"))
    names = re.findall(r"`([\w,]+)`", sentence)
    assert tuple(names[0].split(",")) == BOX_COLUMNS
    assert names[1] in MOMENT_COLUMNS


def test_the_command_of_the_service_is_understood():
    tokens = MarkdownIt().parse((HOW_TO / "live.md").read_text())
    (unit,) = (
        each.content for each in tokens if each.type == "fence" and "ExecStart" in each.content
    )
    parser = configparser.ConfigParser()
    parser.optionxform = str
    parser.read_string(unit)
    program, *arguments = shlex.split(parser["Service"]["ExecStart"])
    assert Path(program).name == "ssiam"
    words = join_box_words(arguments)
    _, bound, _ = app.parse_args(words, print_error=False, exit_on_error=False)
    assert bound.arguments["headless"] is True
    assert bound.arguments["box"] == ["120,80,40,60"]
    # systemd ends a service with SIGTERM, after which the command exits with 128 + 15.
    assert parser["Service"]["SuccessExitStatus"] == "143"
