"""The file that marks a run as finished is written last."""

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.datasets import open_dataset
from ssiam.evaluation.runs.bench import run_task, tasks
from ssiam.evaluation.runs.entries import Entry
from ssiam.stabilize import StabilizerConfig

KCF = Entry("kcf", StabilizerConfig("off"))


@pytest.mark.parametrize(
    ("protocol", "in_the_way"),
    [
        pytest.param("vot", "times", id="times"),
        pytest.param("ope", "times", id="times of one pass"),
        pytest.param("ope", "ope", id="boxes of one pass"),
    ],
)
def test_a_run_whose_other_files_cannot_be_written_is_not_finished(tmp_path, protocol, in_the_way):
    """A run that counted as finished would not be repeated, and its times would stay missing."""
    dataset = write_dataset(tmp_path / "data", sequences=1, frames=6)
    (task,) = tasks([KCF], open_dataset(dataset), dataset, tmp_path / "out", protocol)
    task.results.mkdir(parents=True)
    (task.results / in_the_way).write_text("a file instead of the folder")
    assert "cannot be written" in run_task(task).failed
    assert not task.path.exists()
    (task.results / in_the_way).unlink()
    assert run_task(task).failed == ""
    assert task.path.exists()
