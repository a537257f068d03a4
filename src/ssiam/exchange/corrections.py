"""`read_corrections`: what a person has corrected, from files of CVAT, Label Studio and ssiam."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final

from ssiam.errors import AnnotationsError
from ssiam.exchange.annotations import Annotation, Annotations, rotated_box
from ssiam.exchange.blending import Keyframe
from ssiam.exchange.cvat import read_cvat
from ssiam.exchange.labelstudio import read_labelstudio, timeline
from ssiam.exchange.result_files import read_annotations
from ssiam.geometry import XYWH, xywh_from_corners

# Pixels; exports round to .001, and Label Studio's percentages to less than that.
_SAME: Final = 0.05
_SAME_DEGREES: Final = 0.05


def read_any_annotations(
    path: Path,
    size_wh: tuple[int, int],
    fps: float | Fraction,
    previous: Annotations | None = None,
) -> Annotations:
    """Read a file of an annotation tool or of ``ssiam track``, by the ending of its name.

    Parameters
    ----------
    path : Path
        ``.xml`` of "CVAT for video 1.1", ``.json`` of Label Studio, ``.csv`` or ``.jsonl`` of
        ``ssiam track``. Not trusted.
    size_wh : (int, int)
        Width and height of the video's frames, pixels.
    fps : float or Fraction
        Frames per second.
    previous : Annotations, optional
        What was exported for the tool; from it the frames of a video with a variable frame rate
        are found in files of Label Studio.

    Raises
    ------
    AnnotationsError
        The file is missing, damaged or of another kind.
    """
    suffix = path.suffix.lower()
    if suffix == ".xml":
        return read_cvat(path, size_wh, fps)
    if suffix == ".json":
        return read_labelstudio(
            path, size_wh, fps, None if previous is None else timeline(previous)
        )
    if suffix in (".csv", ".jsonl"):
        return read_annotations(path, size_wh, fps)
    raise AnnotationsError(
        f"{path}: unknown kind of corrections; give .xml of CVAT, .json of Label Studio, or .csv "
        "or .jsonl of ssiam track"
    )


def read_corrections(
    path: Path,
    size_wh: tuple[int, int],
    fps: float | Fraction,
    previous: Annotations | None = None,
) -> list[list[Keyframe]]:
    """The keyframes of each target, in the order of the frames.

    Parameters
    ----------
    path, size_wh, fps
        As for `read_any_annotations`.
    previous : Annotations, optional
        What was exported for the tool. Only boxes of the file that differ from it are keyframes,
        and its own keyframes where the file agrees with it. By default all keyframes of the file
        are.

    Returns
    -------
    list of list of Keyframe
        ``keyframes[target - 1]``; each has at least one with a box.

    Raises
    ------
    AnnotationsError
        As `read_any_annotations`, or a target has no box to start from.
    """
    corrected = read_any_annotations(path, size_wh, fps, previous)
    targets = max((row.target for row in corrected.rows), default=0)
    if not targets:
        raise AnnotationsError(f"{path}: has no boxes: annotate a target in one frame at least")
    if previous is not None and targets > len(previous.names):
        raise AnnotationsError(
            f"{path}: has {targets} targets, but the results before it have {len(previous.names)}: "
            "give the results from which it was exported"
        )
    found = [keyframes_of(corrected, previous, target) for target in range(1, targets + 1)]
    for number, keyframes in enumerate(found, 1):
        if not any(each.xywh for each in keyframes):
            raise AnnotationsError(
                f"{path}: target {number} has no keyframe with a box"
                + ("" if previous is None else ", and none in the results before it")
                + ": correct it in one frame at least"
            )
    return found


def keyframes_of(
    corrected: Annotations, previous: Annotations | None = None, target: int = 1
) -> list[Keyframe]:
    """The keyframes of one target, in the order of the frames, as `read_corrections`."""
    before = None
    if previous is not None:
        before = {row.frame: row for row in previous.rows if row.target == target}
    rows = sorted(
        (row for row in corrected.rows if row.target == target), key=lambda row: row.frame
    )
    return [Keyframe(row.frame, _upright(row)) for row in rows if _is_given(row, before)]


def _is_given(row: Annotation, before: dict[int, Annotation] | None) -> bool:
    if before is None:
        return row.keyframe
    earlier = before.get(row.frame)
    if earlier is None or not earlier.visible:
        return row.visible or (earlier is not None and earlier.keyframe)
    return earlier.keyframe or not _is_same(row, earlier)


def _is_same(row: Annotation, other: Annotation) -> bool:
    """Whether both show the same box or none."""
    if not (row.visible and other.visible):
        return row.visible == other.visible
    first, second = rotated_box(row), rotated_box(other)
    pairs: Sequence[tuple[float, float]] = (
        (first.cx, second.cx),
        (first.cy, second.cy),
        (first.w, second.w),
        (first.h, second.h),
    )
    turned = abs((first.degrees - second.degrees + 45) % 90 - 45)
    return max(abs(a - b) for a, b in pairs) < _SAME and turned < _SAME_DEGREES


def _upright(row: Annotation) -> XYWH | None:
    if not row.visible:
        return None
    return row.xywh if row.corners is None else xywh_from_corners(row.corners)
