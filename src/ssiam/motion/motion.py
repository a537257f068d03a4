"""`Motion`: what the camera did between two frames."""

from __future__ import annotations

from dataclasses import dataclass

from ssiam.geometry import IDENTITY, Transform, frame_centre, rigid_parameters


@dataclass(frozen=True, eq=False)
class Motion:
    """Camera motion from the previous frame to this one.

    Attributes
    ----------
    cur_from_prev : (3, 3) float64
        Takes background points of the previous frame to this frame; raw-frame pixels.
    inliers : float
        Share 0..1 of the followed points that agree with it.
    reliable : bool
        False where the motion could not be told (black frame, blur, scene cut);
        `cur_from_prev` is then the identity.
    size_wh : (int, int)
        Width and height of the frames, pixels.
    """

    cur_from_prev: Transform
    inliers: float
    reliable: bool
    size_wh: tuple[int, int]

    @classmethod
    def none(cls, size_wh: tuple[int, int], *, reliable: bool = False) -> Motion:
        """The motion that moves nothing: first frames, and frames that tell nothing."""
        return cls(IDENTITY, 1.0 if reliable else 0.0, reliable, size_wh)

    @property
    def shift_angle(self) -> tuple[float, float, float]:
        """(dx, dy, da) of eq. 4, taken at the image centre: pixels, pixels, radians."""
        return rigid_parameters(self.cur_from_prev, frame_centre(self.size_wh))
