"""`MotionAhead`: the next frame's motion, estimated while something else runs."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from typing import Any

from numpy.typing import ArrayLike

from ssiam.copying import NotPickled
from ssiam.errors import ArgumentError
from ssiam.geometry import Image, check_frame
from ssiam.motion.camera import CameraMotion
from ssiam.motion.motion import Motion, known_motion


class MotionAhead(NotPickled):
    """A `CameraMotion` that can be set to work on a frame before its motion is asked for.

    Threads: one thread at a time for each object, with one more of its own; the frame given to
    `start` must not be written to before `update` has returned for it.

    Networks leave a core free where there are two. What is left out of the estimate must be
    known when the work starts; the results are those of the camera alone.

    Parameters
    ----------
    camera : CameraMotion

    Examples
    --------
    >>> ahead = MotionAhead(CameraMotion())
    >>> ahead.start(next_frame, exclude=box)
    >>> track = network(frame)
    >>> motion = ahead.update(next_frame, exclude=box)
    """

    _instead = "pickle its CameraMotion, or make one where it is needed"

    def __init__(self, camera: CameraMotion) -> None:
        self._camera = camera
        self._worker: ThreadPoolExecutor | None = None
        self._begun: tuple[Image, Future[Motion]] | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> MotionAhead:
        if self._begun is not None:
            self._begun[1].exception()  # waits: the camera is at work until then
        copied = memo[id(self)] = MotionAhead(deepcopy(self._camera, memo))
        copied._begun = self._begun  # the same frame is waited for
        return copied

    def start(self, frame: Image, exclude: Any = None) -> None:
        """Begin with the motion to `frame`, which must be the next one given to `update`.

        Until then the frame must not be written to. Another one may not be begun before.
        """
        if self._begun is not None:
            raise ArgumentError("a frame is announced already: give it to update first")
        self._worker = self._worker or ThreadPoolExecutor(1, "camera-motion")
        self._begun = frame, self._worker.submit(self._camera.update, frame, exclude)

    def update(
        self, frame: Image, exclude: Any = None, motion: Motion | ArrayLike | None = None
    ) -> Motion:
        """Motion to `frame`, as `CameraMotion.update`; waited for if it was begun.

        Raises
        ------
        ValueError
            Another frame was begun, and is still waited for; or as `CameraMotion.update`.
        """
        if self._begun is None:
            return self._camera.update(frame, exclude, motion)
        begun, found = self._begun
        if begun is not frame:
            raise ArgumentError(
                "this is not the frame that was announced as the next one: give that one first"
            )
        known = None if motion is None else known_motion(motion, check_frame(frame))
        self._begun = None
        estimated = found.result()
        return known or estimated
