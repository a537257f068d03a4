"""Whether the run in a folder is the one that is asked for."""

import json
from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")

from ssiam.errors import ArgumentError  # noqa: E402
from ssiam.training.checkpoints import CHECKPOINT, read_state, write_state  # noqa: E402
from ssiam.training.opening import SourceSettings  # noqa: E402
from ssiam.training.settings import TeacherSettings, TrainSettings  # noqa: E402

SOURCE = SourceSettings("davis", "somewhere")
SETTINGS = TrainSettings((SOURCE, SourceSettings("voc", "elsewhere")), teacher=TeacherSettings("t"))


@pytest.fixture
def folder(tmp_path):
    write_state(tmp_path, SETTINGS, {"step": 6})
    return tmp_path


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"batch": 7}, "(batch is 32 there and 7 here)"),
        ({"sources": (SOURCE,)}, "(sources are 2 there and 1 here)"),
        (
            {"sources": (replace(SOURCE, weight=2.5), *SETTINGS.sources[1:])},
            "(sources[0].weight is 1.0 there and 2.5 here)",
        ),
    ],
)
def test_the_first_difference_is_told_and_nothing_else(folder, changes, told):
    with pytest.raises(ArgumentError) as caught:
        read_state(folder, replace(SETTINGS, **changes))
    assert told in str(caught.value)
    assert len(str(caught.value)) < 200 + len(str(folder))


def test_another_number_of_workers_is_no_other_run(folder):
    assert read_state(folder, replace(SETTINGS, workers=0)) == {"step": 6}


def rewritten(folder, change):
    path = folder / CHECKPOINT
    content = torch.load(path, weights_only=True)
    values = json.loads(content["settings"])
    change(values)
    torch.save({**content, "settings": json.dumps(values)}, path)


def test_a_run_from_before_a_setting_was_known_goes_on(folder):
    rewritten(folder, lambda values: values["sources"][0].pop("rivals"))
    assert read_state(folder, SETTINGS) == {"step": 6}


def test_a_setting_of_a_later_version_makes_it_another_run(folder):
    rewritten(folder, lambda values: values["sources"][0].update(shadows=0.5))
    with pytest.raises(ArgumentError, match=r"sources\[0\].shadows is 0.5 there and None here"):
        read_state(folder, SETTINGS)
