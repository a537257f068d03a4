"""Table 4's Yes and No: the threshold judge on whole sequences."""

import pytest

from helpers.drawn_datasets import SHAKE, write_vot_folder
from ssiam.datasets import Shake, open_dataset, shaken
from ssiam.evaluation.paper.judged import judge_sequences

HANDHELD = Shake(0.01, "handheld")


def answers(*sequences):
    judged, notes = judge_sequences(sequences)
    assert not notes
    return list(judged.values())


def test_a_shaken_sequence_needs_stabilization_and_a_still_one_does_not(tmp_path):
    for folder, shake, answer in (("shaken", SHAKE, True), ("still", (0.0, 0.0, 0.0), False)):
        data = write_vot_folder(tmp_path / folder, {"book": 20}, shake)
        assert answers(open_dataset(data).sequences["book"]) == [answer]


@pytest.mark.parametrize("name", ["sequences/Crossing", "mot/TUD-Campus"])
def test_real_still_cameras_need_none_until_they_are_shaken(shared, name):
    still = next(iter(open_dataset(shared(f"data/{name}")).sequences.values()))
    assert answers(still) == [False]
    assert answers(shaken(still, HANDHELD)) == [True]


def test_a_moving_camera_needs_it(shared):
    found = open_dataset(shared("data/sequences/Jumping")).sequences
    assert answers(*found.values()) == [True]


def test_sequences_without_images_are_named(tmp_path):
    folder = write_vot_folder(tmp_path / "VOT2018", {"soccer2": 4})
    (folder / "soccer2" / "00000003.jpg").write_bytes(b"")
    judged, notes = judge_sequences(open_dataset(folder).sequences.values())
    assert judged == {}
    assert "soccer2: not judged" in notes[0]
    assert "00000003.jpg" in notes[0]
