"""`ssiam eval`: from folders of result files to its tables, its JSON and its complaints."""

import json

import numpy as np
import pytest

from ssiam.cli import main
from ssiam.evaluation.layouts import otb_path, vot_path, write_boxes, write_got10k, write_vot
from ssiam.evaluation.trajectory import Status, Trajectory

LENGTHS = {"bag": 120, "crossing": 400}
KEYS = {"accuracy", "robustness", "eao", "lost", "frames"}
LOST_AT = 40


def truth(length):
    x = 60.0 + np.arange(length)[:, None] / 2
    y = np.full((length, 1), 50.0)
    return np.hstack([x, y, x + 40, y, x + 40, y + 30, x, y + 30])


def dataset(folder, name="VOT2018", **changes):
    """pysot's JSON form, without images."""
    records = {}
    for sequence, length in LENGTHS.items():
        boxes = truth(length).tolist()
        records[sequence] = {
            "video_dir": sequence,
            "init_rect": boxes[0],
            "img_names": [f"{sequence}/color/{n + 1:08d}.jpg" for n in range(length)],
            "gt_rect": boxes,
            "camera_motion": [int(n < 60) for n in range(length)],
            "occlusion": [int(n >= 60) for n in range(length)],
            "width": 320,
            "height": 240,
            **changes,
        }
    path = folder / f"{name}.json"
    path.write_text(json.dumps(records))
    return path


def results(folder, shift=0.0, lost=(), lengths=LENGTHS):
    """A tracker's folder: `shift` pixels beside the truth, lost once in the sequences `lost`."""
    for name, length in lengths.items():
        status = np.full(length, Status.TRACKED, np.int8)
        status[0] = Status.INITIALIZED
        if name in lost:
            status[LOST_AT : LOST_AT + 6] = [2, 0, 0, 0, 0, 1]
        regions = np.where(status[:, None] == Status.TRACKED, truth(length) + shift, np.nan)
        write_vot(vot_path(folder, name), Trajectory(status, regions))
    return folder


@pytest.fixture
def vot2018(tmp_path):
    return dataset(tmp_path)


def run(*arguments):
    return main(["eval", *map(str, arguments)])


def test_json_of_one_tracker(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "good", lost=("bag",))
    assert run(folder, "--dataset", vot2018, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {key: set(value) for key, value in found.items()} == {"pysot": KEYS, "vot_toolkit": KEYS}
    assert found["pysot"]["lost"] == found["vot_toolkit"]["lost"] == 1
    assert found["pysot"]["frames"] == found["vot_toolkit"]["frames"] == 520
    assert found["pysot"]["robustness"] == pytest.approx(100 / 520)
    assert found["vot_toolkit"]["robustness"] == pytest.approx(120 / 520)
    assert found["pysot"]["accuracy"] == found["vot_toolkit"]["accuracy"] == 1


def test_json_of_several_trackers_and_their_comparison(vot2018, tmp_path, capsys):
    results(tmp_path / "all" / "a", lost=("bag",))
    results(tmp_path / "all" / "b", shift=3)
    (tmp_path / "all" / "notes").mkdir()
    assert run(tmp_path / "all", "--dataset", vot2018, "--json", "--compare") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["trackers"]) == ["a", "b"]
    assert set(found["trackers"]["b"]["pysot"]) == KEYS
    difference = found["comparison"]["b"]
    assert difference["reference"] == "a"
    assert difference["lost"]["value"] == -1
    assert difference["accuracy"]["value"] < 0
    assert difference["accuracy"]["share_below_zero"] == 1


def test_tables_for_people(vot2018, tmp_path, capsys):
    results(tmp_path / "all" / "a", lost=("bag",))
    results(tmp_path / "all" / "b[red]", shift=3)
    assert run(tmp_path / "all", "--dataset", vot2018, "--compare") == 0
    told = capsys.readouterr()
    assert told.err == ""
    assert told.out.index("camera_motion") < told.out.index("occlusion")
    for words in ("pysot", "vot-toolkit", "b[red]", "0.192", "0.231", "minus"):
        assert words in told.out
    assert max(map(len, told.out.splitlines())) <= 120


def test_what_is_missing_is_told_and_the_rest_is_measured(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "short", lengths={"bag": 110})
    assert run(folder, "--dataset", vot2018, "--json") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["pysot"]["frames"] == 110
    missing = [line for line in told.err.splitlines() if "crossing" in line]
    short = [line for line in told.err.splitlines() if "bag_001.txt" in line]
    assert [line.endswith("it is left out") for line in missing] == [True]
    assert ["110 lines for 120 frames; the first 110" in line for line in short] == [True]
    assert any("no sequence has more than 110 frames" in line for line in told.err.splitlines())


def test_too_long_files_are_cut(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "long", lengths={"bag": 130, "crossing": 400})
    assert run(folder, "--dataset", vot2018, "--json") == 0
    told = capsys.readouterr()
    assert "130 lines for 120 frames" in told.err
    assert json.loads(told.out)["vot_toolkit"]["frames"] == 520


def test_what_cannot_be_told_is_null(tmp_path, capsys):
    path = dataset(tmp_path, "VOT2016")
    folder = results(tmp_path / "short", lengths={"bag": 90, "crossing": 80})
    assert run(folder, "--dataset", path, "--json") == 0
    assert json.loads(capsys.readouterr().out)["vot_toolkit"]["eao"] is None


def test_the_year_may_be_given(tmp_path, capsys):
    path, folder = dataset(tmp_path, "copy"), results(tmp_path / "good", lost=("bag",))
    found = []
    for year in (2018, 2019):
        assert run(folder, "--dataset", path, "--json", "--year", year) == 0
        found.append(json.loads(capsys.readouterr().out)["pysot"]["eao"])
    assert found[0] != found[1]


def test_the_realtime_runs(vot2018, tmp_path, capsys):
    results(tmp_path / "t", lost=("bag",))
    (tmp_path / "t" / "baseline").rename(tmp_path / "t" / "realtime")
    assert run(tmp_path / "t", "--dataset", vot2018, "--experiment", "realtime", "--json") == 0
    assert json.loads(capsys.readouterr().out)["pysot"]["lost"] == 1


@pytest.fixture
def inputs(tmp_path):
    """Good and bad folders and datasets side by side."""
    dataset(tmp_path)
    dataset(tmp_path, "copy")
    dataset(tmp_path, "VOT2017", width=None)
    results(tmp_path / "good")
    results(tmp_path / "others", lengths={"another": 20})
    (tmp_path / "empty").mkdir()
    (tmp_path / "nothing" / "baseline").mkdir(parents=True)
    for name, text in [("damaged", "1\n1,2,3\n"), ("hollow", ""), ("endless", "2\n1\n2\n")]:
        results(tmp_path / name)
        vot_path(tmp_path / name, "bag").write_text(text)
    return tmp_path


REFUSED = [
    # name, arguments, words of the message
    ("no results", ("gone", "--dataset", "VOT2018.json"), "gone: there is no such folder"),
    ("an empty folder", ("empty", "--dataset", "VOT2018.json"), "empty: neither it nor a folder"),
    ("no files", ("nothing", "--dataset", "VOT2018.json"), "nothing: holds no results"),
    ("other sequences", ("others", "--dataset", "VOT2018.json"), "others: holds no results"),
    ("damaged", ("damaged", "--dataset", "VOT2018.json"), "bag_001.txt, line 2"),
    ("hollow", ("hollow", "--dataset", "VOT2018.json"), "bag_001.txt: is empty"),
    ("no start", ("endless", "--dataset", "VOT2018.json"), "more failures (2) than starts"),
    ("no dataset", ("good",), "--dataset"),
    ("missing dataset", ("good", "--dataset", "gone.json"), "gone.json"),
    ("no year", ("good", "--dataset", "copy.json"), "give --year"),
    ("unknown year", ("good", "--dataset", "copy.json", "--year", "2030"), "VOT2030"),
    ("no size", ("good", "--dataset", "VOT2017.json"), "sequence bag"),
    ("compare one", ("good", "--dataset", "VOT2018.json", "--compare"), "--compare needs"),
]


@pytest.mark.parametrize(
    ("arguments", "named"), [pytest.param(*case[1:], id=case[0]) for case in REFUSED]
)
def test_bad_input_is_one_line_that_names_it(inputs, arguments, named, capsys, monkeypatch):
    monkeypatch.chdir(inputs)
    assert run(*arguments) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("ssiam: ")
    assert named in told.err
    assert told.err.count("\n") == 1


def test_help_is_documentation(capsys):
    run("--help")
    told = " ".join(capsys.readouterr().out.split())
    for word in ("--dataset", "--year", "--json", "--compare", "pysot", "vot-toolkit"):
        assert word in told


def test_the_authors_raw_results(shared, capsys):
    folder = shared("data/vot/results/VOT2018/model_SiamMask_E_ref")
    assert run(folder, "--dataset", shared("data/vot/VOT2018.json"), "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["pysot"]["lost"] == found["vot_toolkit"]["lost"] == 54
    assert found["pysot"]["eao"] == pytest.approx(0.4457, abs=1e-3)
    assert found["vot_toolkit"]["robustness"] == pytest.approx(1.156, abs=1e-3)


def one_pass_folder(folder, layout, shift):
    """Boxes of OTB's truth, moved by `shift` pixels, in one of the layouts."""
    boxes = np.tile([20.0 + shift, 10.0, 30.0, 40.0], (12, 1))
    run = Trajectory.of_boxes(boxes)
    if layout == "otb":
        write_boxes(otb_path(folder, "clip"), run)
    elif layout == "bench":
        write_boxes(otb_path(folder / "ope", "clip"), run)
    elif layout == "got10k":
        write_got10k(folder, "clip", [run])
    else:
        write_vot(vot_path(folder, "clip", experiment="unsupervised"), run)
    return folder


@pytest.fixture
def otb(tmp_path):
    folder = tmp_path / "OTB100" / "clip"
    (folder / "img").mkdir(parents=True)
    for number in range(12):
        (folder / "img" / f"{number + 1:04d}.jpg").write_bytes(b"")
    (folder / "groundtruth_rect.txt").write_text("21,11,30,40\n" * 12)
    return folder.parent


@pytest.mark.parametrize("layout", ["otb", "bench", "got10k", "vot"])
def test_one_pass_results_of_every_layout_give_the_same(layout, otb, tmp_path, capsys):
    folder = one_pass_folder(tmp_path / "runs" / "half", layout, shift=15.0)
    arguments = ["eval", str(folder), "--dataset", str(otb), "--experiment", "ope", "--json"]
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ao"] == pytest.approx(1 / 3)
    assert found["success"] == pytest.approx(7 / 21)
    assert found["precision"] == 1
    assert found["normalised_precision"] == 0
    assert found["sequences"] == 1


def test_a_folder_of_one_pass_trackers_is_a_table(otb, tmp_path, capsys):
    for name, shift in (("good", 0.0), ("bad", 60.0)):
        one_pass_folder(tmp_path / "runs" / name, "bench", shift)
    arguments = ["eval", str(tmp_path / "runs"), "--dataset", str(otb), "--experiment", "ope"]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "good" in told
    assert "bad" in told


def test_a_folder_without_one_pass_results_is_told(otb, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    arguments = ["eval", str(tmp_path / "empty"), "--dataset", str(otb), "--experiment", "ope"]
    assert main(arguments) == 2
    assert "one-pass results" in capsys.readouterr().err
