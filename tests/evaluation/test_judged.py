"""Table 4's Yes and No: the threshold judge on whole sequences."""

import cv2
import numpy as np
import pytest

from helpers.drawn_datasets import SHAKE, write_vot_folder
from ssiam.datasets import Shake, VideoSequence, open_dataset, shaken
from ssiam.evaluation.paper import camera_motions as motions_module
from ssiam.evaluation.paper import judged as judged_module
from ssiam.evaluation.paper.camera_motions import _target, camera_motions
from ssiam.evaluation.paper.judged import WINDOW_JUDGE, judge_sequences, needs_stabilization
from ssiam.geometry import rigid
from ssiam.motion import Motion
from ssiam.stabilize import PaperConfig, StabilizerConfig

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


SIZE = (640, 360)


def moved(*shifts):
    return [Motion.from_transform(rigid(dx, 0, 0), SIZE) for dx in shifts]


@pytest.mark.parametrize(
    ("shifts", "answer"),
    [
        ((0, 9, 0, 9), True),  # the path is away from its mean in three of four frames
        ((0, 0, 9), False),
        ((0, 0, 9, 9), False),  # in half of them
        ((0, 0, 9, 9, 9), True),
        ((), False),
    ],
)
def test_more_than_half_of_the_frames_shake(shifts, answer):
    assert needs_stabilization(moved(*shifts)) is answer


def test_the_judge_of_the_window_by_default():
    assert PaperConfig(judge="window") == WINDOW_JUDGE
    slight = moved(*[0.2, -0.2] * 10)
    assert not needs_stabilization(slight)
    assert needs_stabilization(slight, PaperConfig(gate=0.05))


@pytest.fixture
def filmed(tmp_path):
    """Four frames, with a target that is unknown in the second."""
    images = []
    for number in range(4):
        images.append(tmp_path / f"{number}.png")
        cv2.imwrite(str(images[-1]), np.full((12, 16, 3), number, np.uint8))
    truth = np.array([[1.0, 2, 3, 4], [np.nan] * 4, [5, 6, 7, 8]])
    return VideoSequence("s", tuple(images), truth)


def test_the_true_box_of_the_frame_before_is_excluded(filmed, monkeypatch):
    made = []

    class Camera:
        def __init__(self, *given, **options):
            self.given, self.calls = (given, options), []
            made.append(self)

        def update(self, image, exclude):
            self.calls.append((int(image[0, 0, 0]), exclude))
            return len(self.calls)

    monkeypatch.setattr(motions_module, "CameraMotion", Camera)
    config = StabilizerConfig("paper", "gftt", "least_squares", spread=False)
    assert list(camera_motions(filmed, config)) == [1, 2, 3, 4]
    (camera,) = made
    assert camera.given == (("gftt", "least_squares"), {"model": "rigid", "spread": False})
    assert [number for number, _ in camera.calls] == [0, 1, 2, 3]
    assert [exclude for _, exclude in camera.calls] == [None, (1, 2, 3, 4), None, (5, 6, 7, 8)]


def test_sequences_are_judged_by_the_papers_keypoints(filmed, monkeypatch):
    calls = []

    def motions(sequence, config):
        calls.append(config)
        return moved(0, 9, 0, 9)

    monkeypatch.setattr(judged_module, "camera_motions", motions)
    assert judge_sequences([filmed]) == ({"s": True}, [])
    assert calls == [StabilizerConfig("paper")]


def test_frames_after_the_ground_truth_have_no_box(filmed):
    found = [_target(filmed, index) for index in range(-1, 5)]
    assert found == [None, (1, 2, 3, 4), None, (5, 6, 7, 8), None, None]
