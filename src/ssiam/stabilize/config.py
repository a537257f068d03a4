"""`StabilizerConfig`: the paper's numbers, each with its symbol and unit."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real
from typing import Final, Literal, TypeAlias, get_args

from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import shortened
from ssiam.motion import KEYPOINTS, FitName, KeypointName

Method: TypeAlias = Literal["off", "paper", "literal", "predict"]
_NOT_NEGATIVE: Final = ("gate", "border", "thx1", "thy1", "thx2", "thy2", "tha", "margin")
_SHARES: Final = ("memory", "smoothing")
METHODS: tuple[Method, ...] = get_args(Method)


@dataclass(frozen=True)
class StabilizerConfig:
    """How frames are steadied; the defaults are the paper's numbers where it has them.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    stabilize : {"predict", "paper", "literal", "off"}
        "predict" moves the frame so that the target lies where the tracker last saw it; "paper"
        moves it onto the smoothed camera path; "literal" is eq. 5 as printed, which puts one
        frame's shake back in (for ablation); "off" leaves every frame alone.
    keypoints : {"direct", "orb", "gftt", "harris", "brisk", "mser"}, optional
        Keypoint generator of the camera motion (Table 2); "direct" needs none, and is faster
        and surer. Unless given, "direct" for "predict" and the paper's "orb" for the others.
    fit : {"robust", "least_squares"}
        Rigid fit of the camera motion; least squares is the printed form (eq. 3).
    window : int
        Frames of the camera path that are averaged, the current one included.
    gate : float
        Threshold judge of Fig. 2, pixels: a frame whose pixels are all within this distance of
        the smoothed path is not steadied.
    border : int
        N of eq. 6: pixels added on each side of the steadied frame, so that nothing is lost.
    thx1 : float
        THx1 of eq. 6, pixels: the shift along x is at most N + THx1.
    thy1 : float
        THy1 of eq. 6, pixels: the shift along y is at most N + THy1.
    thx2 : float
        THx2 of eq. 6, pixels per frame: how much the shift along x may change.
    thy2 : float
        THy2 of eq. 6, pixels per frame: how much the shift along y may change.
    tha : float
        THa of eq. 6, radians: the largest rotation.
    choose : bool
        Of "predict": choose among four predictions by how good they were of late; without it the
        camera's motion and the target's speed are always believed.
    speed : bool
        Of "predict": the target's own speed counts.
    turn : bool
        Of "predict": the camera's roll is taken out of the view.
    trust : bool
        Of "predict": boxes in which the tracker hardly believes tell less, and no speed.
    find : bool
        Of "predict": a target that is lost is looked for where it was in the scene.
    memory : float
        Of "predict", 0..1: weight of the past in the running errors of the predictions.
    smoothing : float
        Of "predict", 0..1: weight of the past in the target's speed.
    margin : float
        Of "predict", in target sizes: by how much a prediction must be better than "where it was".
    """

    stabilize: Method = "predict"
    keypoints: KeypointName = None  # type: ignore[assignment]  # the method's own, once made
    fit: FitName = "robust"
    window: int = 30
    gate: float = 0.1
    border: int = 20
    thx1: float = 60.0
    thy1: float = 30.0
    thx2: float = 20.0
    thy2: float = 10.0
    tha: float = 0.3
    choose: bool = True
    speed: bool = True
    turn: bool = True
    trust: bool = True
    find: bool = True
    memory: float = 0.8
    smoothing: float = 0.5
    margin: float = 0.1

    def __post_init__(self) -> None:
        check_choice("stabilize", self.stabilize, METHODS)
        if self.keypoints is None:
            own: KeypointName = "direct" if self.stabilize == "predict" else "orb"
            object.__setattr__(self, "keypoints", own)
        check_choice("keypoints", self.keypoints, KEYPOINTS)
        check_choice("fit", self.fit, get_args(FitName))
        for name in ("window", "border"):
            self._check(name, Integral, "a whole number")
        for name in (*_NOT_NEGATIVE, *_SHARES):
            self._check(name, Real, "a number")
        for name in ("choose", "speed", "turn", "trust", "find"):
            self._check(name, bool, "True or False")
        if self.window < 1:
            raise ArgumentError(f"window is {self.window} frames: it must be at least 1")
        for name in _NOT_NEGATIVE:
            if not getattr(self, name) >= 0:
                raise ArgumentError(f"{name} is {getattr(self, name)}: it must not be negative")
        for name in _SHARES:
            if not 0 <= getattr(self, name) < 1:
                raise ArgumentError(f"{name} is {getattr(self, name)}: it must be in 0..1, below 1")

    def _check(self, name: str, kind: type, wanted: str) -> None:
        value = getattr(self, name)
        if not isinstance(value, kind):
            raise ArgumentError(f"{name} is {shortened(value)}: it must be {wanted}")
