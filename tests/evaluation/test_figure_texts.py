"""Names, titles and captions of the figures, with nothing drawn."""

from types import SimpleNamespace

import numpy as np
import pytest

from ssiam.errors import MissingExtraError
from ssiam.evaluation.paper import figures as module
from ssiam.evaluation.paper.canvas import NothingToDrawError
from ssiam.evaluation.paper.figures import Figure, figures
from ssiam.stabilize import StabilizerConfig

SEQUENCE = SimpleNamespace(name="road", images=lambda: iter([np.zeros((60, 80, 3), np.uint8)]))
CALLS = (
    *("examples", "failures", "results", "draw_strips", "record_camera", "draw_path"),
    *("draw_correction", "most_moved", "draw_transformed", "largest_difference"),
    *("draw_boxes", "draw_ranking", "draw_eao_curve"),
)


@pytest.fixture
def drawn(monkeypatch):
    """The calls of all parts by name; they return what the figures need."""
    example = SimpleNamespace(tracker="kcf", sequence=SEQUENCE, one_pass=False, frames=[3])
    returned = {
        "examples": [example],
        "failures": [SimpleNamespace(example=example)],
        "results": [SimpleNamespace(example=example)],
        "record_camera": "record",
        "most_moved": 7,
        "largest_difference": example,
    }
    calls = {}

    def fake(name):
        def call(*given, **options):
            calls.setdefault(name, []).append((given, options))
            value = returned.get(name, name.encode())
            if isinstance(value, Exception):
                raise value
            return value

        return call

    for name in CALLS:
        monkeypatch.setattr(module, name, fake(name))
    return SimpleNamespace(calls=calls, returned=returned, example=example)


def summaries(year=2018, sequences=()):
    return SimpleNamespace(dataset="VOT2018", year=year, sequences=dict(sequences))


BOTH = "Restarted five frames after each loss; no box in between."


def test_figures_of_a_year_of_vot(drawn):
    found, notes = figures(summaries())
    assert notes == []
    assert found == [
        Figure(
            "fig1-VOT2018",
            "Fig. 1: where kcf alone loses its target",
            "Yellow: the tracker alone. Green: the truth; the dashed line is at the same height in "
            "each frame, so that the background shows the shake. The paper's masks are not in "
            f"result files. {BOTH}",
            b"draw_strips",
        ),
        Figure(
            "fig3-VOT2018",
            "Fig. 3: the camera's path in road",
            "Motion at the image center, summed over the frames, and its mean over the last 30 "
            "frames. Gray: frames with unreliable motion.",
            b"draw_path",
        ),
        Figure(
            "fig4-VOT2018",
            "Fig. 4: the correction of each frame of road",
            "dx, dy and da of new_trans (eq. 5), before the limits of eq. 6: from the camera's "
            "path to the smoothed one.",
            b"draw_correction",
        ),
        Figure(
            "fig5-VOT2018",
            "Fig. 5: frame 7 of road, original and transformed",
            "The frame that is moved farthest. 20 pixels are added on each side (N of eq. 6).",
            b"draw_transformed",
        ),
        Figure(
            "fig6-VOT2018",
            "Fig. 6: kcf alone and stabilized",
            "Yellow: the tracker alone. Blue: stabilized. Green: the truth. The first frame, then "
            f"those in which the stabilized box is better by the most. {BOTH}",
            b"draw_strips",
        ),
        Figure(
            "boxes-VOT2018",
            "Boxes: kcf on road, alone and stabilized",
            "The frames with the largest difference of overlap, for better or worse, on the "
            f"sequence with the largest difference. {BOTH}",
            b"draw_boxes",
        ),
        Figure(
            "ranking-VOT2018",
            "Ranking: accuracy and robustness on VOT2018",
            "Dashed or hollow: the tracker alone. Solid or filled: stabilized.",
            b"draw_ranking",
        ),
        Figure(
            "eao-VOT2018",
            "Expected average overlap on VOT2018",
            "Mean overlap that is expected in a video of so many frames, with 0 after a loss; the "
            "mean over the gray interval of VOT2018 is EAO (in the legend). Dashed: the tracker "
            "alone.",
            b"draw_eao_curve",
        ),
    ]


def test_each_part_gets_what_it_draws(drawn):
    found = summaries()
    figures(found, ["road"])
    calls, example = drawn.calls, drawn.example
    strips = drawn.returned["failures"]
    assert [given for given, _ in calls["examples"]] == [(found, ["road"])] * 3
    assert calls["failures"] == [(([example],), {"limit": False})]
    assert calls["results"] == [(([example],), {"limit": False})]
    assert [options for _, options in calls["draw_strips"]] == [
        {"stabilized": False},
        {"stabilized": True},
    ]
    assert calls["draw_strips"][0][0] == (strips,)
    assert calls["record_camera"] == [((SEQUENCE, StabilizerConfig("paper")), {})]
    assert calls["draw_path"] == calls["draw_correction"] == [(("record",), {})]
    assert calls["most_moved"] == [(("record", (80, 60)), {})]
    assert calls["draw_transformed"] == [((SEQUENCE, "record", 7, 20), {})]
    assert calls["draw_boxes"] == [((example,), {})]
    for name in ("largest_difference", "draw_ranking", "draw_eao_curve"):
        assert calls[name] == [((found,), {})]
    figures(found)
    assert calls["failures"][1][1] == calls["results"][1][1] == {"limit": True}


def test_one_pass_runs_and_other_datasets_are_named(drawn):
    drawn.example.one_pass = True
    found = {each.name.partition("-")[0]: each for each in figures(summaries(None))[0]}
    for name in ("fig1", "fig6", "boxes"):
        assert found[name].caption.endswith(" One pass, no restarts.")
    assert found["ranking"].title == "Ranking: success on VOT2018"
    assert found["eao"].caption == (
        "Mean overlap that is expected in a video of so many frames, with 0 after a loss; no "
        "interval is defined for this dataset, so that it has no EAO. Dashed: the tracker alone."
    )


def test_without_examples_the_camera_is_that_of_the_first_sequence(drawn):
    drawn.returned["examples"] = NothingToDrawError("nothing\nto draw")
    other = SimpleNamespace(name="lake", images=SEQUENCE.images)
    found, notes = figures(summaries(sequences={"lake": other, "road": SEQUENCE}))
    titles = [each.title for each in found]
    assert titles[0] == "Fig. 3: the camera's path in lake"
    assert notes == [
        "VOT2018: no figure 1: nothing to draw",
        "VOT2018: no figure 6: nothing to draw",
    ]
    found, _ = figures(summaries(sequences={"lake": other, "road": SEQUENCE}), ["x", "road"])
    assert found[0].title == "Fig. 3: the camera's path in road"
    _, notes = figures(summaries(sequences={"lake": other}), ["x"])
    assert [note.partition(": nothing")[0] for note in notes] == [
        *("VOT2018: no figure 1", "VOT2018: no figures 3 to 5", "VOT2018: no figure 6"),
    ]


@pytest.mark.parametrize("example", [None, SimpleNamespace(frames=[])])
def test_without_a_difference_there_are_no_boxes(drawn, example):
    drawn.returned["largest_difference"] = example
    found, notes = figures(summaries())
    assert "boxes-VOT2018" not in [each.name for each in found]
    assert notes == [
        "VOT2018: no figure of boxes: no sequence has both off and paper results with different "
        "boxes"
    ]


def test_other_errors_are_notes_and_a_missing_extra_is_not(drawn):
    drawn.returned["draw_ranking"] = ValueError("no luck")
    drawn.returned["draw_eao_curve"] = KeyError("x")
    _, notes = figures(summaries())
    assert notes[0] == "VOT2018: no ranking: ValueError: no luck"
    assert notes[1].startswith("VOT2018: no curve of EAO: KeyError")
    drawn.returned["draw_ranking"] = MissingExtraError("matplotlib")
    with pytest.raises(MissingExtraError):
        figures(summaries())
