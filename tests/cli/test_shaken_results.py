"""`ssiam eval` and `ssiam tables` of results under added shake."""

import json

import numpy as np
import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.datasets import Shake, open_dataset, shaken
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.runs.result_files import otb_path, vot_path, write_boxes, write_vot
from ssiam.evaluation.runs.shaken_results import write_shake


def perfect(dataset, out, shake):
    """Results of a tracker that outputs the shaken ground truth."""
    for name, raw in open_dataset(dataset).sequences.items():
        truth = shaken(raw, shake).truth
        status = np.full(len(truth), Status.TRACKED, np.int8)
        status[0] = Status.INITIALIZED
        regions = np.where(status[:, None] == Status.TRACKED, truth, np.nan)
        write_vot(vot_path(out / "perfect", name), Trajectory(status, regions))
        write_boxes(otb_path(out / "perfect" / "ope", name), Trajectory.from_regions(truth))
    write_shake(out, shake)
    return out


def evaluated(capsys, *arguments):
    assert main(["eval", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


SETTINGS = {
    "white": Shake(0.03),
    "crop": Shake(0.02, "zoom", border="crop"),
    "rolling and blurred": Shake(0.03, "gusts", 1, exposure=0.5, readout=0.5),
}


@pytest.mark.parametrize("shake", SETTINGS.values(), ids=SETTINGS)
def test_only_the_shaken_truth_scores_1(shake, tmp_path, capsys):
    dataset = write_dataset(tmp_path / "data", sequences=1, frames=40)
    out = perfect(dataset, tmp_path / "out", shake)
    sized = pysot_json(dataset, tmp_path), "--year", 2018
    found = evaluated(capsys, out / "perfect", "--dataset", *sized)
    for convention in ("pysot", "vot_toolkit"):
        assert found[convention]["accuracy"] == pytest.approx(1, abs=2e-3)
    assert found == evaluated(capsys, out, "--dataset", *sized)
    one_pass = evaluated(capsys, out, "--dataset", dataset, "--experiment", "ope")
    assert one_pass["trackers"]["perfect"]["ao"] == pytest.approx(1, abs=2e-3)
    (out / "shake.json").unlink()
    raw = evaluated(capsys, out / "perfect", "--dataset", *sized)
    assert raw["vot_toolkit"]["accuracy"] < 0.95


def pysot_json(dataset, folder):
    """The dataset as pysot's file for VOT2018, which has frame sizes and no images."""
    records = {
        name: {
            "video_dir": name,
            "init_rect": each.truth[0].tolist(),
            "img_names": [f"{name}/{n}.jpg" for n in range(len(each))],
            "gt_rect": each.truth.tolist(),
            "width": 160,
            "height": 120,
        }
        for name, each in open_dataset(dataset).sequences.items()
    }
    path = folder / "VOT2018.json"
    path.write_text(json.dumps(records))
    return path


GOOD = {"strength": 0.03, "kind": "white", "seed": 0, "exposure": 0, "readout": 0, "border": "crop"}
DAMAGED = {
    "empty": b"",
    "no text": b"\xff\xfe\x00",
    "cut off": json.dumps(GOOD).encode()[:-5],
    "a list": b"[0.03]",
    "deep": b"[" * 500,
    "long": json.dumps(GOOD).encode() + b" " * 600,
    "a field too few": json.dumps({"strength": 0.03}).encode(),
    "a field too many": json.dumps({**GOOD, "angle": 3}).encode(),
    "a word for a number": json.dumps({**GOOD, "strength": "much"}).encode(),
    "true for a number": json.dumps({**GOOD, "seed": True}).encode(),
    "half a seed": json.dumps({**GOOD, "seed": 0.5}).encode(),
    "nan": json.dumps({**GOOD, "strength": float("nan")}).encode(),
    "out of range": json.dumps({**GOOD, "strength": 7}).encode(),
    "a negative seed": json.dumps({**GOOD, "seed": -1}).encode(),
    "an endless number": json.dumps(GOOD).replace("0.03", "9" * 300).encode(),
    "unknown kind": json.dumps({**GOOD, "kind": "sway\n"}).encode(),
    "a list for a kind": json.dumps({**GOOD, "kind": ["white"]}).encode(),
    "unknown border": json.dumps({**GOOD, "border": ""}).encode(),
}


@pytest.mark.parametrize("command", ["eval", "tables"])
@pytest.mark.parametrize("text", DAMAGED.values(), ids=DAMAGED)
def test_damaged_shake_file_gives_one_line_error(text, command, dataset, tmp_path, capsys):
    perfect(dataset, tmp_path, Shake(0.03))
    (tmp_path / "shake.json").write_bytes(text)
    more = ["--no-figures"] if command == "tables" else []
    assert main([command, str(tmp_path), "--dataset", str(dataset), *more]) == 2
    error = capsys.readouterr().err
    assert error.startswith("ssiam: ")
    assert "shake.json: " in error
    assert error.count("\n") == 1
    assert len(error) < 600
