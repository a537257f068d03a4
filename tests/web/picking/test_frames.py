"""`FrameReader`: the right frame for every index, whatever the source."""

from __future__ import annotations

import pytest

from helpers.picking import FRAMES, NumberedClip, number_of, numbered_image
from ssiam.errors import SourceError
from ssiam.web.picking.frames import FrameReader


def always(frame):
    return True


@pytest.mark.parametrize("order", [range(FRAMES), range(FRAMES - 1, -1, -1), [20, 3, 21, 4, 0, 23]])
@pytest.mark.parametrize("kept", [1, 5, 100])
def test_every_index_is_its_frame(order, kept):
    reader = FrameReader(NumberedClip(), kept * numbered_image(0).nbytes)
    for index in order:
        frame = reader.read(index, always)
        assert (frame.index, number_of(frame.image)) == (index, index)


def test_recent_frames_are_not_decoded_again():
    clip = NumberedClip()
    reader = FrameReader(clip, 5 * numbered_image(0).nbytes)
    reader.read(20, always)
    decoded = clip.decoded
    for index in (19, 18, 20, 17):
        reader.read(index, always)
    assert (clip.decoded, clip.opened) == (decoded, 1)


@pytest.mark.parametrize("breaks", [False, True])
@pytest.mark.parametrize("announced", [None, FRAMES - 3, FRAMES + 50])
def test_the_last_frame_stands_for_all_after_it(announced, breaks):
    reader = FrameReader(NumberedClip(FRAMES, announced, breaks), 3 * numbered_image(0).nbytes)
    assert reader.length == announced
    for _ in range(2):
        assert reader.read(1000, always).index == FRAMES - 1
        assert reader.length == FRAMES
        assert reader.read(2, always).index == 2


def test_reading_ends_at_a_frame_that_is_enough():
    reader = FrameReader(NumberedClip())
    passed = []

    def is_wanted(frame):
        passed.append(frame.index)
        return frame.index < 6

    assert reader.read(20, is_wanted).index == 6
    assert passed == list(range(7))
    assert reader.read(7, always).index == 7


def test_a_source_that_is_gone_is_refused_and_the_open_one_continues():
    clip = NumberedClip()
    reader = FrameReader(clip, 1)
    reader.read(9, always)

    def fail():
        raise SourceError("clip: no such file")

    reader._open = fail
    with pytest.raises(SourceError, match="no such file"):
        reader.read(0, always)
    assert reader.read(10, always).index == 10
