"""`LabelStudioBackend`: `predict` as Label Studio's ML backend calls it, for VideoRectangle."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, Final

from ssiam.errors import ArgumentError
from ssiam.exchange.annotations import (
    Annotation,
    Annotations,
    annotation_from_track,
)
from ssiam.exchange.blending import Keyframe
from ssiam.exchange.corrections import keyframes_of
from ssiam.exchange.labelstudio import region_annotations, region_value
from ssiam.geometry import short_repr
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker, TrackerGroup
from ssiam.video import Frame, Source, open_source

_KIND: Final = "videorectangle"
_REMEMBERED: Final = 64  # predictions, for comparison with what a person has changed


class LabelStudioBackend:
    """Tracks the regions of a `VideoRectangle` from their keyframes on.

    Threads: one thread at a time.

    From each keyframe, a target is tracked to the next one or to the end of the video. Boxes that
    this object has predicted itself before are not keyframes, unless they were changed.

    Parameters
    ----------
    tracker : StabilizedTracker
        Prototype: each region gets a clone.
    path_of : callable, optional
        The path of a video on this machine, given its address in the task and the task: Label
        Studio's `get_local_path`. By default addresses are paths.
    video : str
        Key of the video in ``task["data"]``.
    most_frames : int, optional
        Largest number of frames that are tracked from the first keyframe on; by default all.

    Examples
    --------
    >>> class Backend(LabelStudioMLBase):
    ...     def setup(self):
    ...         path_of = lambda url, task: self.get_local_path(url, task_id=task["id"])
    ...         self.backend = LabelStudioBackend(ssiam.load_tracker(), path_of=path_of)
    ...
    ...     def predict(self, tasks, context=None, **kwargs):
    ...         return self.backend.predict(tasks, context)
    """

    def __init__(
        self,
        tracker: StabilizedTracker,
        *,
        path_of: Callable[[str, Mapping[str, Any]], str] | None = None,
        video: str = "video",
        most_frames: int | None = None,
    ) -> None:
        self._tracker = tracker
        self._path_of = path_of
        self._video = video
        self._most_frames = most_frames
        self._predicted: dict[tuple[Any, str], Annotations] = {}

    def predict(
        self,
        tasks: Sequence[Mapping[str, Any]],
        context: Mapping[str, Any] | None = None,
        **kwargs: Any,
    ) -> list[dict[str, Any]]:
        """One prediction for each task.

        Parameters
        ----------
        tasks : sequence of dict
            As Label Studio sends them: `id`, `data`, `annotations`.
        context : dict, optional
            ``context["result"]`` has the regions that a person has drawn, of the one task. Without
            it the regions of the task's last annotation are used.
        **kwargs
            Not used.

        Returns
        -------
        list of dict
            ``{"model_version", "score", "result"}``; `result` is empty without a region.

        Raises
        ------
        SsiamError
            A task or region has another form, the video cannot be read, or a box does not fit
            it.
        """
        checked = [_mapping("a task", task) for task in tasks]
        return [self._prediction(task, _regions(task, context)) for task in checked]

    def _prediction(
        self, task: Mapping[str, Any], regions: Sequence[Mapping[str, Any]]
    ) -> dict[str, Any]:
        if not regions:
            return {"model_version": "ssiam", "score": 0.0, "result": []}
        with self._open(task) as frames:
            size_wh, fps, length = frames.size_wh, frames.fps, frames.length or 0
            drawn = [region_annotations(region, size_wh, fps) for region in regions]
            keyframes = [
                keyframes_of(found, self._predicted.get(_key(task, region)))
                for found, region in zip(drawn, regions, strict=True)
            ]
            rows, last = _tracked(self._limited(frames, keyframes), self._tracker, keyframes)
        result, scores = [], []
        for region, own, found in zip(regions, drawn, rows, strict=True):
            tracked = Annotations(size_wh, fps, own.names, tuple(found), max(length, last + 1))
            self._remember(_key(task, region), tracked)
            value = dict(region.get("value", {})) | region_value(tracked)
            result.append({**region, "value": value})
            scores += [row.score for row in found if row.visible]
        score = sum(scores) / len(scores) if scores else 0.0
        return {"model_version": "ssiam", "score": round(score, 4), "result": result}

    def _open(self, task: Mapping[str, Any]) -> Source:
        address = _mapping("data", task.get("data", {})).get(self._video)
        if not isinstance(address, str):
            raise ArgumentError(
                f"task {task.get('id')} has no video: data has no text under {self._video!r}"
            )
        return open_source(address if self._path_of is None else self._path_of(address, task))

    def _limited(self, frames: Source, keyframes: Sequence[Sequence[Keyframe]]) -> Iterator[Frame]:
        if self._most_frames is None:
            return iter(frames)
        first = min((own[0].frame for own in keyframes if own), default=0)
        return islice(frames, first + self._most_frames)

    def _remember(self, key: tuple[Any, str], tracked: Annotations) -> None:
        self._predicted.pop(key, None)
        self._predicted[key] = tracked
        while len(self._predicted) > _REMEMBERED:
            self._predicted.pop(next(iter(self._predicted)))


def _key(task: Mapping[str, Any], region: Mapping[str, Any]) -> tuple[Any, str]:
    return task.get("id"), str(region.get("id"))


def _regions(task: Mapping[str, Any], context: Mapping[str, Any] | None) -> list[Mapping[str, Any]]:
    """The regions of a VideoRectangle that a person has drawn."""
    drawn = _mapping("the context", context or {}).get("result")
    if not drawn:
        annotations = _list("annotations", task.get("annotations"))
        last = annotations[-1] if annotations else {}
        drawn = _mapping("an annotation", last).get("result")
    regions = [_mapping("a region", each) for each in _list("result", drawn)]
    return [each for each in regions if each.get("type") == _KIND]


def _mapping(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{name} is {short_repr(value)}: give an object of Label Studio's JSON")
    return value


def _list(name: str, value: Any) -> list[Any]:
    if value and not isinstance(value, list):
        raise ArgumentError(f"{name} is {short_repr(value)}: give a list of Label Studio's JSON")
    return value or []


def _tracked(
    frames: Iterator[Frame], tracker: StabilizedTracker, keyframes: Sequence[Sequence[Keyframe]]
) -> tuple[list[list[Annotation]], int]:
    """Rows of each target from its first keyframe on, and the last frame that was read."""
    group = TrackerGroup(tracker)
    given = [{each.frame: each.xywh for each in own} for own in keyframes]
    running: list[tuple[int, StabilizedTracker]] = []
    rows: list[list[Annotation]] = [[] for _ in keyframes]
    last = -1
    for frame in frames:
        if last < 0:
            group.init(frame.image, [])
        tracks = (
            {}
            if last < 0
            else dict(
                zip([target for target, _ in running], group.update(frame.image), strict=True)
            )
        )
        last = frame.index
        for target, own in enumerate(given):
            if frame.index in own:
                for each in [each for each in running if each[0] == target]:
                    group.leave(each[1])
                    running.remove(each)
                xywh = own[frame.index]
                tracks.pop(target, None)
                if xywh is None:
                    continue
                fresh = group.new_tracker()
                fresh.init(frame.image, xywh)
                group.join(fresh, xywh)
                running.append((target, fresh))
                tracks[target] = Track(xywh, keyframe=True)
            if target in tracks:
                upright = tracks[target].with_changes(corners=None)
                row = annotation_from_track(frame.index, frame.time, 1, upright)
                rows[target].append(row)
    return rows, last
