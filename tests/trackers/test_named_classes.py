"""Trackers by ``package.module:Class`` and by entry points; which sources of names refuse them."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import ssiam
from helpers.foreign_package import write_entry_point, write_package
from ssiam.errors import ArgumentError, WeightsError
from ssiam.integrations import cvat_agent
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import check_tracker_name

FRAME = np.random.default_rng(1).integers(0, 256, (200, 300, 3)).astype(np.uint8)
BOX = (100.0, 80.0, 40.0, 30.0)


@pytest.fixture
def others(tmp_path, monkeypatch):
    """Name of a module of trackers that can be imported."""
    monkeypatch.syspath_prepend(str(tmp_path))
    yield write_package(tmp_path)
    for name in [name for name in sys.modules if name.startswith("others_")]:
        del sys.modules[name]


def made(tracker):
    return tracker._tracker.tracker


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_a_class_is_loaded_by_its_path(others, stabilize):
    tracker = ssiam.load_tracker(f"{others}:Still", stabilize=stabilize)
    tracker.init(FRAME, BOX)
    assert tracker.update(FRAME).box == pytest.approx(BOX)
    assert not tracker.score_is_calibrated
    assert type(made(ssiam.load_tracker(f"{others}:Outer.Inner"))).__name__ == "Inner"


def test_weights_and_threads_are_given_to_a_class_that_takes_them(others, tmp_path):
    tracker = ssiam.load_tracker(f"{others}:Weighted", weights=str(tmp_path), threads=3)
    assert type(made(tracker)).made == [(Path(tmp_path), 3, None)]
    tracker.clone()
    assert type(made(tracker)).made == [(Path(tmp_path), 3, None)] * 2
    assert made(ssiam.load_tracker(f"{others}:Optional")).weights is None
    assert made(ssiam.load_tracker(f"{others}:Optional", weights="w")).weights == Path("w")


def test_entry_points_are_trackers_by_name(others, tmp_path):
    write_entry_point(tmp_path, "others_still", f"{others}:Still")
    tracker = ssiam.load_tracker("others_still", stabilize="off")
    tracker.init(FRAME, BOX)
    assert tracker.update(FRAME).score == 0.5
    with pytest.raises(ArgumentError, match=r"choose from lite, .*others_still"):
        ssiam.load_tracker("others_moving")


def test_an_entry_point_does_not_replace_a_tracker_of_the_package(others, tmp_path):
    write_entry_point(tmp_path, "kcf", f"{others}:Still")
    assert type(ssiam.load_tracker("kcf")._tracker).__name__ == "OpenCvTracker"


WRONG = {
    "no module": ("no_such_package:A", {}, "there is no module no_such_package; install"),
    "no submodule": ("ssiam.no_such:A", {}, "there is no module ssiam.no_such;"),
    "no class": ("others_trackers:Nothing", {}, "others_trackers has no Nothing; it has Still, "),
    "no trackers": ("json:Nothing", {}, "json has no Nothing, and no class with init and update"),
    "no inner class": ("others_trackers:Outer.X", {}, "has no Outer.X"),
    "a number": ("others_trackers:NUMBER", {}, "is int, not a class"),
    "no tracker": ("json:JSONDecoder", {}, "JSONDecoder is not a tracker: it has no init"),
    "fails": ("others_trackers:Broken", {}, "cannot be made: OSError: no such device"),
    "no weights": ("others_trackers:Weighted", {}, "needs weights: give --weights PATH"),
    "weights": ("others_trackers:Still", {"weights": "w"}, "has no parameter weights: leave w out"),
    "precision": ("others_trackers:Still", {"precision": "bf16"}, "leave precision and device out"),
    "distractors": ("others_trackers:Still", {"distractors": True}, "leave distractors out"),
    "memory": ("others_trackers:Still", {"template_memory": True}, "it has no memory"),
    "no form": ("others-trackers:Still", {}, "unknown tracker 'others-trackers:Still'"),
    "empty": (":Still", {}, "unknown tracker ':Still'"),
    "no name": (5, {}, "unknown tracker 5"),
}


@pytest.mark.parametrize(("name", "options", "message"), WRONG.values(), ids=WRONG.keys())
def test_what_cannot_be_loaded_is_one_line(others, name, options, message):
    with pytest.raises((ArgumentError, WeightsError)) as raised:
        ssiam.load_tracker(name, **options)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import no_such_dependency", "importing others_bad failed (No module named"),
        ("1 / 0", "importing others_bad failed (ZeroDivisionError: division by zero)"),
        ("def broken(:", "importing others_bad failed (SyntaxError: "),
        ("import sys; sys.exit('leaving')", "importing others_bad failed (SystemExit: leaving)"),
    ],
)
def test_a_module_that_fails_is_one_line(others, tmp_path, source, message):
    write_package(tmp_path, "others_bad", source)
    with pytest.raises(ArgumentError) as raised:
        ssiam.load_tracker("others_bad:Tracker")
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_checking_a_name_imports_nothing(others):
    assert check_tracker_name(f"{others}:Still") == f"{others}:Still"
    assert others not in sys.modules


def test_names_from_elsewhere_run_no_code(others, tmp_path, monkeypatch):
    """CVAT's configuration, and benchmarks whose names are not from `ssiam bench`."""
    from ssiam.evaluation.runs.entries import entries

    monkeypatch.setattr(cvat_agent, "CvatTrackingFunction", lambda tracker: tracker)
    write_entry_point(tmp_path, "others_still", f"{others}:Still")
    for name in (f"{others}:Still", "others_still"):
        with pytest.raises(ArgumentError, match="unknown tracker"):
            cvat_agent.create(tracker=name)
        with pytest.raises(ArgumentError, match="unknown tracker"):
            entries([name], ["off"], {})
    assert others not in sys.modules


def test_a_message_of_a_page_names_no_tracker(others):
    """The words of a page are boxes, numbers and methods; a field "tracker" is ignored."""
    from ssiam.web.server.incoming import parse_message

    name = f"{others}:Still"
    for text in (
        {"type": "steady", "method": name},
        {"type": "tracker", "name": name},
        {"type": "load", "tracker": name},
    ):
        with pytest.raises(ssiam.SsiamError):
            parse_message(json.dumps(text))
    message = parse_message(json.dumps({"type": "steady", "method": "off", "tracker": name}))
    assert name not in repr(message)
    assert others not in sys.modules


def test_a_description_of_a_network_names_no_class(others, tmp_path):
    from ssiam.toml_tables import read_toml
    from ssiam.trackers.one_stream import OneStreamDescription

    path = tmp_path / "tracker.toml"
    path.write_text(f'network = "{others}:Still"\n')
    with pytest.raises(ArgumentError, match=r"name an \.onnx file"):
        read_toml(OneStreamDescription, path)
    assert others not in sys.modules


def test_the_places_that_load_trackers_by_name_are_known():
    """A new place must take its names from the command line, or accept those of TRACKERS alone."""
    source = Path(ssiam.__file__).parent
    found = {
        path.relative_to(source).as_posix()
        for path in source.rglob("*.py")
        if re.search(r"(?<!def )\b(load_tracker|load_named)\(", path.read_text(encoding="utf-8"))
        and path.name != "__init__.py"  # an example in a docstring
    }
    assert found == {
        "cli/check_tracker.py",
        "cli/options.py",
        "evaluation/runs/entries.py",
        "integrations/cvat_agent.py",
        "integrations/label_studio_backend.py",  # in a docstring
        "trackers/registry.py",
    }


def test_an_entry_of_a_benchmark_has_a_label_that_is_a_folders_name(others):
    from ssiam.evaluation.paper.summary import parse_label
    from ssiam.evaluation.runs.entries import entries

    (entry,) = entries([f"{others}:Still"], ["off"], {}, named_classes=True, template_memory=True)
    assert entry.label == "others_trackers.Still-off-template_memory=True"
    assert parse_label(entry.label) == ("others_trackers.Still", StabilizerConfig("off"))
    assert entry.options.threads == 1
