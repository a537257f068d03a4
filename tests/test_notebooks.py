"""The notebooks run from top to bottom, as in a kernel: one namespace, in their own folder."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


def run(notebook):
    """Run the code cells; returns the value that each cell would show."""
    namespace = {"__name__": "__main__"}
    shown = []
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]), f"cell {number}")
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, f"cell {number}", "exec"), namespace)
        if last is not None:
            code = compile(ast.Expression(last.value), f"cell {number}", "eval")
            shown.append(eval(code, namespace))
    return namespace, [value for value in shown if value is not None]


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request, monkeypatch):
    monkeypatch.chdir(request.param.parent)
    return json.loads(request.param.read_text(encoding="utf-8"))


def test_there_are_two():
    assert [path.stem for path in NOTEBOOKS] == ["camera_motion", "track"]


def test_a_notebook_has_no_outputs_and_the_current_format(notebook):
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    ids = [cell["id"] for cell in notebook["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in notebook["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_a_notebook_runs_and_shows_images(notebook):
    _, shown = run(notebook)
    images = [value for value in shown if hasattr(value, "_repr_png_")]
    assert len(images) == 2
    assert all(image._repr_png_().startswith(b"\x89PNG") for image in images)
    assert all("\n" not in repr(value) for value in shown)


def test_the_walker_is_tracked_to_the_end(monkeypatch):
    monkeypatch.chdir(ROOT / "examples" / "notebooks")
    track = json.loads(Path("track.ipynb").read_text(encoding="utf-8"))
    namespace, _ = run(track)
    assert len(namespace["tracks"]) == 116
    assert not namespace["lost"]


def test_the_estimated_motion_is_the_true_one(monkeypatch, capsys):
    monkeypatch.chdir(ROOT / "examples" / "notebooks")
    motion = json.loads(Path("camera_motion.ipynb").read_text(encoding="utf-8"))
    namespace, _ = run(motion)
    assert max(namespace["errors"]) < 1
    assert "median shake" in capsys.readouterr().out
