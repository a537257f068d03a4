"""`MotionAhead`: the next frame's motion, estimated while something else runs."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from numpy.typing import ArrayLike

from ssiam.errors import ArgumentError
from ssiam.geometry import Image, check_frame
from ssiam.motion.camera import CameraMotion
from ssiam.motion.motion import Motion, known_motion


class MotionAhead:
    """A `CameraMotion` that can be set to work on a frame before its motion is asked for.

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

    def __init__(self, camera: CameraMotion) -> None:
        self._camera = camera
        self._worker: ThreadPoolExecutor | None = None
        self._begun: tuple[Image, Future[Motion]] | None = None

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
