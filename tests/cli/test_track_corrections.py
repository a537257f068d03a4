"""`ssiam track --corrections`: what a person has corrected is tracked again and blended."""

import shutil
from xml.etree import ElementTree

import numpy as np
import pytest

from helpers.tracked_clip import COUNT, box_of, decoded, rows_of
from ssiam.cli import main
from ssiam.trackers.box_mask import BOUNDS_THRESHOLDS, BoxMask

KCF = ("--tracker", "kcf")


@pytest.fixture
def truth(clip, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(clip[0], "clip.mp4")
    return clip[1]


def write_cvat(path, keyframes):
    """A file of CVAT with targets by keyframes: {frame: xywh, or None where it is outside}."""
    root = ElementTree.Element("annotations")
    for number, own in enumerate(keyframes):
        track = ElementTree.SubElement(root, "track", id=str(number), label="boat")
        for frame, box in own.items():
            x, y, w, h = box or (0, 0, 9, 9)
            names = {"xtl": x, "ytl": y, "xbr": x + w, "ybr": y + h}
            names |= {"frame": frame, "outside": int(box is None), "keyframe": 1}
            ElementTree.SubElement(track, "box", {k: str(v) for k, v in names.items()})
    ElementTree.ElementTree(root).write(path)


def track(*arguments):
    return main(["track", "clip.mp4", *map(str, arguments), *KCF])


def distances(rows, truth):
    return [
        float(np.hypot(float(r["x"]) - t[0], float(r["y"]) - t[1]))
        for r, t in zip(rows, truth, strict=True)
    ]


def test_from_a_keyframe_in_the_middle_to_both_ends(truth, tmp_path, capsys):
    write_cvat("c.xml", [{20: truth[20]}])
    assert track("--corrections", "c.xml") == 0
    rows = rows_of(tmp_path / "clip-tracked.csv")
    assert [int(row["frame"]) for row in rows] == list(range(COUNT))
    assert max(distances(rows, truth)) < 10
    assert [row["frame"] for row in rows if row["keyframe"] == "1"] == ["20"]
    assert rows[20]["x"] == f"{truth[20][0]:.3f}".rstrip("0")
    assert rows[0]["dx"] == ""
    assert abs(float(rows[1]["dx"])) > 0
    assert len(decoded(tmp_path / "clip-tracked.mp4")[0]) == COUNT
    assert "clip.mp4 between keyframes" in capsys.readouterr().out


def test_keyframes_are_kept_exactly_and_others_follow_their_size(truth, tmp_path):
    """The person's boxes are larger than the target by a quarter; so is the whole track."""
    large = [(x - 5, y - 5, w + 10, h + 10) for x, y, w, h in truth]
    write_cvat("c.xml", [{frame: large[frame] for frame in (0, 13, 39)}])
    assert track("--corrections", "c.xml", "--results", "r.csv") == 0
    rows = rows_of(tmp_path / "r.csv")
    for frame in (0, 13, 39):
        assert [float(rows[frame][name]) for name in "xywh"] == pytest.approx(
            large[frame], abs=1e-3
        )
    assert [float(row["w"]) for row in rows] == pytest.approx([46] * COUNT, abs=2)
    assert max(distances(rows, large)) < 8


def test_an_absent_target_is_lost_up_to_its_next_keyframe(truth, tmp_path):
    write_cvat("c.xml", [{0: truth[0], 10: None, 25: truth[25]}, {5: truth[5]}])
    assert track("--corrections", "c.xml", "--results", "r.csv") == 0
    rows = rows_of(tmp_path / "r.csv")
    first = [row["lost"] for row in rows if row["target"] == "1"]
    assert first == ["0"] * 10 + ["1"] * 15 + ["0"] * 15
    second = [row for row in rows if row["target"] == "2"]
    assert max(distances(second, truth)) < 10


def test_round_after_round_with_the_exported_results(truth, tmp_path):
    """Track, export, correct a box, track again, export, correct another one."""
    assert track("--box", box_of(truth[0]), "--results", "1.csv") == 0
    for previous, results, frame in (("1.csv", "2.csv", 30), ("2.csv", "3.csv", 12)):
        export = ["export", previous, "--to", "cvat", "--video", "clip.mp4", "--out", "c.xml"]
        assert main([*export, "--overwrite"]) == 0
        tree = ElementTree.parse("c.xml")
        x, y, w, h = truth[frame]
        shape = next(each for each in tree.iter("box") if each.get("frame") == str(frame))
        for name, value in (("xtl", x), ("ytl", y - 4), ("xbr", x + w), ("ybr", y + h + 4)):
            shape.set(name, str(value))
        tree.write("c.xml")
        given = ("--corrections", "c.xml", "--previous", previous)
        assert track(*given, "--results", results) == 0
    rows = rows_of(tmp_path / "3.csv")
    assert [row["frame"] for row in rows if row["keyframe"] == "1"] == ["0", "12", "30"]


def test_masks_follow_the_corrected_boxes(truth, tmp_path):
    write_cvat("c.xml", [{8: truth[8]}])
    arguments = ["track", "clip.mp4", "--corrections", "c.xml", "--end", "12"]
    assert main([*arguments, "--results", "r.csv", "--out", "o.mp4"]) == 0
    rows = rows_of(tmp_path / "r.csv")
    assert all(row["x1"] for row in rows)
    for row in rows:
        center = np.mean([[float(row[f"{axis}{n}"]) for axis in "xy"] for n in "1234"], axis=0)
        middle = float(row["x"]) + float(row["w"]) / 2, float(row["y"]) + float(row["h"]) / 2
        assert np.abs(center - middle).max() < 8


def test_the_edges_of_masks_are_in_the_boxes(truth, tmp_path, monkeypatch):
    """The mask is 20 px wider than the box in one frame; half of that is added."""
    seen = []

    def bounds(self, view, xywh):
        seen.append(xywh)
        x, y, w, h = xywh
        return np.tile((x, y, w + 20 * (len(seen) == 6), h), (len(BOUNDS_THRESHOLDS), 1))

    monkeypatch.setattr(BoxMask, "bounds", bounds)
    write_cvat("c.xml", [{8: truth[8], 12: None, 14: truth[14]}])
    arguments = ["track", "clip.mp4", "--corrections", "c.xml", "--end", "16"]
    assert main([*arguments, "--results", "r.csv"]) == 0
    widths = [float(row["w"]) for row in rows_of(tmp_path / "r.csv") if row["lost"] == "0"]
    masked = [w for _, _, w, _ in seen]
    assert len(masked) == 12 + 3
    gains = np.subtract(widths, masked)
    assert gains == pytest.approx([10 * (frame == 5) for frame in range(15)], abs=1e-2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--corrections", "c.xml", "--box", "1,2,3,4"], "--corrections gives all boxes"),
        (["--corrections", "c.xml", "--backward"], "omit --backward"),
        (["--corrections", "c.xml", "--pick"], "omit --corrections"),
        (["--previous", "r.csv"], "--previous r.csv is compared with --corrections"),
        (["--corrections", "none.xml"], "none.xml: cannot be read"),
        (["--corrections", "late.xml"], "target 1: the keyframe in frame 99 is outside of"),
        (["--corrections", "far.xml"], "target 1, frame 3: box"),
        (["--corrections", "c.xml", "--out", "c.xml"], "c.xml"),
    ],
)
def test_wrong_arguments_give_one_line_and_write_nothing(
    truth, tmp_path, capsys, arguments, message
):
    write_cvat("c.xml", [{0: truth[0]}])
    write_cvat("late.xml", [{99: truth[0]}])
    write_cvat("far.xml", [{3: (900, 900, 10, 10)}])
    before = {path.name for path in tmp_path.iterdir()}
    assert track(*arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == before


def test_a_stream_is_refused_before_it_is_read(truth, capsys):
    write_cvat("c.xml", [{0: truth[0]}])
    assert main(["track", "-", "--corrections", "c.xml", *KCF]) == 2
    assert "cannot be read from its end" in capsys.readouterr().err


@pytest.mark.parametrize("view", ["stabilized", "locked"])
def test_video_has_another_view(truth, capsys, view):
    write_cvat("c.xml", [{0: truth[0], 39: truth[39]}])
    assert track("--corrections", "c.xml", "--out", "o.mp4", "--view", view) == 0
    assert len(decoded("o.mp4")[0]) == COUNT
    assert f"view: {view}, planned for the whole clip" in capsys.readouterr().out
