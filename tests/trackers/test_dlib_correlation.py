"""dlib's correlation tracker; skipped without dlib."""

import copy
import sys

import numpy as np
import pytest

import ssiam
from helpers.tracker_loops import BOX, SIZE, marker_frame
from ssiam import FrameView
from ssiam.errors import ArgumentError, CopyError, MissingExtraError
from ssiam.testing import CHECKS
from ssiam.trackers.dlib_correlation import DlibTracker


def test_without_dlib_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "dlib", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'ssiam\[dlib\]'"):
        ssiam.load_tracker("dlib")


@pytest.mark.parametrize("check", CHECKS, ids=str)
def test_dlib_passes_the_checks(check):
    pytest.importorskip("dlib")
    assert check(DlibTracker) or "candidate" in check.name


def test_refusals():
    pytest.importorskip("dlib")
    tracker = DlibTracker()
    view = FrameView(marker_frame(BOX))
    with pytest.raises(ArgumentError, match="no target yet"):
        tracker.update(view)
    with pytest.raises(ArgumentError, match="box of 1x9 pixels"):
        tracker.init(view, (5, 5, 1, 9))
    copy.deepcopy(tracker)
    tracker.init(view, BOX)
    with pytest.raises(CopyError, match="cannot be copied"):
        copy.deepcopy(tracker)
    for options in ({"weights": "w"}, {"precision": "bf16"}, {"distractors": True}):
        with pytest.raises(ssiam.SsiamError, match="leave"):
            ssiam.load_tracker("dlib", **options)
    assert not ssiam.load_tracker("dlib").score_is_calibrated
    assert np.asarray(view.raw).shape[1::-1] == SIZE
