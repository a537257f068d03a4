"""Every code block of README and the documentation is run, or at least parsed."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from markdown_it import MarkdownIt

from ssiam.cli.main import app
from ssiam.video import VideoSink, open_source

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PAGES = [
    *[ROOT / name for name in ("README.md", "CONTRIBUTING.md", "examples/README.md")],
    *[ROOT / "benchmarks/README.md", *sorted((ROOT / "docs").rglob("*.md"))],
]
PAGES = [page for page in PAGES if page.exists()]
CLIP = ROOT / "examples" / "shaky-walker.mp4"

# Code that the examples of a page assume to have run.
SETUP = {
    "docs/how-to/exchange.md": """
import ssiam
from ssiam.video import open_source
frames = open_source("clip.mp4")
frame = next(frames)
group = ssiam.TrackerGroup(ssiam.load_tracker("kcf"))
group.init(frame.image, [(53, 114, 26, 66)])
""",
    "examples/README.md": """
import ssiam
dx, dy, angle = 3.0, 4.0, 0.01
""",
}
# Run by other tests, against a session, or in the packages that they are about (`make hosts`).
TESTED_ELSEWHERE = {"docs/how-to/mavlink.md", "docs/how-to/other-trackers.md"}
# Pages whose commands all run on the example clip.
RUNS = {"docs/tutorials/first-target.md"}
FRAMES = 40  # of the example clip, for these pages


def blocks(page, *languages):
    """The contents of a page's code blocks in some languages."""
    tokens = MarkdownIt().enable("table").parse(page.read_text(encoding="utf-8"))
    return [t.content for t in tokens if t.type == "fence" and t.info in languages]


def commands(page):
    """The commands in a page's console blocks, as lists of words without comments."""
    text = "\n".join(blocks(page, "console")).replace("\\\n", " ")
    lines = [shlex.split(line, comments=True) for line in text.splitlines()]
    return [line for line in lines if line]


def page_params(pages):
    """Pages as parameters, with their path as the test id."""
    return [pytest.param(page, id=str(page.relative_to(ROOT))) for page in pages]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A current folder with the example clip under the names that the pages use."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for name in ("clip.mp4", "clip.mov"):
        shutil.copyfile(CLIP, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", page_params(PAGES))
def test_every_block_is_of_a_kind_that_is_tested(page):
    for token in MarkdownIt().enable("table").parse(page.read_text(encoding="utf-8")):
        assert token.type != "code_block", f"indented: {token.content}"
        if token.type == "fence":
            assert token.info in {"python", "console", "json", "toml", "xml", "text"}, token.content


@pytest.mark.parametrize("page", page_params([page for page in PAGES if blocks(page, "python")]))
def test_python_runs(page, folder):
    name = str(page.relative_to(ROOT))
    if name in TESTED_ELSEWHERE:
        pytest.skip("tested elsewhere")
    code = "\n".join([SETUP.get(name, ""), *blocks(page, "python")])
    paths = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=240,
        env=os.environ | {"PYTHONPATH": paths},
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", page_params([page for page in PAGES if commands(page)]))
def test_commands_are_understood(page):
    for program, *arguments in commands(page):
        text = shlex.join([program, *arguments])
        if program == "ssiam":
            app.parse_args(arguments, print_error=False, exit_on_error=False)
        elif program == "python":
            script = ROOT / arguments[0]
            source = "".join(
                path.read_text(encoding="utf-8") for path in [script, *script.parent.glob("*.py")]
            )
            for option in re.findall(r"--[a-z-]+", text):
                assert f'"{option}"' in source, f"{text}: {option}"
        elif program == "make":
            assert f"\n{arguments[0]}: " in (ROOT / "Makefile").read_text(), text
        elif program == "pip":
            for extra in re.findall(r"\[([a-z,]+)\]", text):
                extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
                assert set(extra.split(",")) <= set(extras["optional-dependencies"]), text
        else:
            assert program in {"sudo", "apt-get", "dpkg-deb", "pre-commit", "docker", "export"}, (
                text
            )


@pytest.mark.parametrize("page", page_params([ROOT / name for name in sorted(RUNS)]))
def test_commands_run(page, tmp_path, monkeypatch):
    (tmp_path / "examples").mkdir()
    with (
        open_source(CLIP) as source,
        VideoSink(tmp_path / "examples" / CLIP.name, source.fps) as sink,
    ):
        for frame, _ in zip(source, range(FRAMES), strict=False):
            sink.write(frame.image)
    shutil.copyfile(tmp_path / "examples" / CLIP.name, tmp_path / "clip.mp4")
    monkeypatch.chdir(tmp_path)
    for program, *arguments in commands(page):
        if program != "ssiam":
            continue
        displays = ("DISPLAY", "WAYLAND_DISPLAY")
        environment = {name: value for name, value in os.environ.items() if name not in displays}
        done = subprocess.run(
            [sys.executable, "-m", "ssiam", *arguments],
            capture_output=True,
            text=True,
            timeout=240,
            env=environment,
        )
        if arguments[0] == "track" and not {"--box", "--pick"} & set(arguments):
            # Nobody can click here: tests/web/page/test_picking.py does.
            assert (done.returncode, "no browser" in done.stderr) == (2, True), done.stderr
            continue
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", page_params(PAGES))
def test_data_can_be_parsed(page):
    for text in blocks(page, "toml"):
        tomllib.loads(text)
    for text in blocks(page, "json"):
        json.loads(text)
    for text in blocks(page, "xml"):
        ElementTree.fromstring(text)
