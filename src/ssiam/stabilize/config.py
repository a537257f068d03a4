"""`StabilizerConfig`: the settings of stabilization, each with its symbol and unit."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from numbers import Integral, Real
from typing import Any, Final, Literal, TypeAlias, get_args

from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import short_repr
from ssiam.motion import KEYPOINTS, MODELS, CameraModelName, FitName, KeypointName

Method: TypeAlias = Literal["off", "paper", "literal", "predict"]
METHODS: tuple[Method, ...] = get_args(Method)
JudgeName: TypeAlias = Literal["frame", "window"]
LimitOrder: TypeAlias = Literal["nested", "exclusive"]
AngleLimit: TypeAlias = Literal["angle", "change"]
AngleUnit: TypeAlias = Literal["rad", "deg"]
_CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "judge": get_args(JudgeName),
    "limits": get_args(LimitOrder),
    "tha_limits": get_args(AngleLimit),
    "tha_unit": get_args(AngleUnit),
}


_PAPER_NUMBERS: Final = ("gate", "border", "thx1", "thy1", "thx2", "thy2", "tha", "shake")
# px, between still cameras (up to .2) and hand-held shake of 1 % of the width (2.4 and more);
# from benchmarks/calibration/paper_method.py.
SHAKE: Final = 0.7


def _check_type(config: object, name: str, kind: type, expected: str) -> None:
    value = getattr(config, name)
    if not isinstance(value, kind):
        raise ArgumentError(f"{name} is {short_repr(value)}: it must be {expected}")


def _check_not_negative(config: object, name: str) -> None:
    value = getattr(config, name)
    if not value >= 0:
        raise ArgumentError(f"{name} is {value}: it must not be negative")


@dataclass(frozen=True)
class PaperConfig:
    """Settings of the smoothed camera path ("paper" and "literal"); defaults of the paper.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    window : int
        Frames of the camera path that are averaged, the current one included.
    gate : float
        Threshold of the judge "frame", pixels. The paper gives no number.
    border : int
        N of eq. 6: pixels added on each side of the stabilized frame, so that nothing is lost.
        "predict" uses it too.
    thx1 : float
        THx1 of eq. 6, pixels: the shift along x is at most N + THx1.
    thy1 : float
        THy1 of eq. 6, pixels: the shift along y is at most N + THy1.
    thx2 : float
        THx2 of eq. 6, pixels per frame: the largest change of the shift along x.
    thy2 : float
        THy2 of eq. 6, pixels per frame: the largest change of the shift along y.
    tha : float
        THa of eq. 6, in `tha_unit`: the largest rotation, or its largest change.
    judge : {"frame", "window"}
        Threshold judge of Fig. 2. "frame" does not move a frame whose pixels are all within
        `gate` of the smoothed path. "window" sums squared distances along x and y over the last
        `window` frames, as the paper says, and does not move any frame of a still camera.
    shake : float
        Threshold of the judge "window", pixels: root mean square distance of the path from the
        smoothed path. From benchmarks/calibration/paper_method.py.
    limits : {"nested", "exclusive"}
        Eq. 6: "nested" limits the shift and then its change; "exclusive" applies only the first
        case that holds, as printed, so that a shift at its limit may be reached in one frame.
    tha_limits : {"angle", "change"}
        What THa limits: the rotation, or its change from frame to frame.
    tha_unit : {"rad", "deg"}
        Unit of `tha`; the paper gives none.

    Raises
    ------
    ArgumentError
        A value is of the wrong type or out of its range.
    """

    window: int = 30
    gate: float = 0.1
    border: int = 20
    thx1: float = 60.0
    thy1: float = 30.0
    thx2: float = 20.0
    thy2: float = 10.0
    tha: float = 0.3
    judge: JudgeName = "frame"
    shake: float = SHAKE
    limits: LimitOrder = "nested"
    tha_limits: AngleLimit = "angle"
    tha_unit: AngleUnit = "rad"

    def __post_init__(self) -> None:
        for name in ("window", "border"):
            _check_type(self, name, Integral, "a whole number")
        for name in _PAPER_NUMBERS:
            _check_type(self, name, Real, "a number")
        if self.window < 1:
            raise ArgumentError(f"window is {self.window} frames: it must be at least 1")
        for name in _PAPER_NUMBERS:
            _check_not_negative(self, name)
        for name, choices in _CHOICES.items():
            check_choice(name, getattr(self, name), choices)

    @property
    def tha_rad(self) -> float:
        """THa of eq. 6, radians."""
        return self.tha if self.tha_unit == "rad" else math.radians(self.tha)


@dataclass(frozen=True)
class PredictConfig:
    """Settings of "predict", which centers the view on the predicted target position.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    choose : bool
        Choose among four predictions by their recent errors; without it the camera motion and the
        target's speed are always applied.
    speed : bool
        Use the target's own speed.
    turn : bool
        Remove the camera's roll from the view.
    trust : bool
        Give low-score boxes less weight in the prediction errors and none in the speed.
    prefer : bool
        Prefer candidates near the predicted position, if the tracker can list its candidates.
    find : bool
        Search for a lost target at its position in the scene.
    memory : float
        0..1: weight of the past in the running errors of the predictions.
    smoothing : float
        0..1: weight of the past in the target's speed.
    margin : float
        Target sizes by which a prediction must be better than the last position.

    Raises
    ------
    ArgumentError
        A value is of the wrong type or out of its range.
    """

    choose: bool = True
    speed: bool = True
    turn: bool = True
    trust: bool = True
    prefer: bool = True
    find: bool = True
    memory: float = 0.8
    smoothing: float = 0.5
    margin: float = 0.1

    def __post_init__(self) -> None:
        for name in ("choose", "speed", "turn", "trust", "prefer", "find"):
            _check_type(self, name, bool, "True or False")
        for name in ("memory", "smoothing", "margin"):
            _check_type(self, name, Real, "a number")
        _check_not_negative(self, "margin")
        for name in ("memory", "smoothing"):
            if not 0 <= getattr(self, name) < 1:
                raise ArgumentError(f"{name} is {getattr(self, name)}: it must be in [0, 1)")


_PARTS: Final[dict[str, type[PaperConfig] | type[PredictConfig]]] = {
    "paper": PaperConfig,
    "predict": PredictConfig,
}


@dataclass(frozen=True, repr=False)
class StabilizerConfig:
    """How frames are stabilized.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    stabilize : {"predict", "paper", "literal", "off"}
        What the tracker sees; a written video is moved by a virtual camera instead
        (`ssiam.render`). "predict" moves the frame so that the target appears where the tracker
        last saw it, whether or not the image is still then; "paper"
        moves it onto the smoothed camera path; "literal" is eq. 5 as printed, which adds one
        frame's shake again (for ablation); "off" does not move frames.
    keypoints : {"direct", "orb", "gftt", "harris", "brisk", "mser"}, optional
        Keypoint generator of the camera motion (Table 2); "direct" aligns pixels instead, and is
        faster and more robust. By default "direct" for "predict", and the paper's "orb" for the
        other methods.
    fit : {"robust", "least_squares"}
        How the camera motion is fitted to keypoints; least squares is the printed form (eq. 3).
    spread : bool
        Use only the strongest keypoint of each of 16x12 cells of the frame, so that the keypoints
        are evenly spread; not used by "direct".
    paper : PaperConfig
        Settings of "paper" and "literal".
    predict : PredictConfig
        Settings of "predict".
    motion_model : {"rigid", "similarity", "affine", "homography", "mesh"}
        Degrees of freedom of the camera motion (`CameraMotion`). "rigid" is the paper's.
        "predict" applies the motion at the target, so that a tilted ground ("homography") and
        depth ("mesh", with keypoints "direct" only) move the view as they move the target.

    Raises
    ------
    ArgumentError
        A value is of the wrong type or not one of the choices.

    Examples
    --------
    >>> config = StabilizerConfig("paper", paper=PaperConfig(thx1=80.0))
    >>> config == StabilizerConfig("paper").with_options(thx1=80.0)
    True
    """

    stabilize: Method = "predict"
    keypoints: KeypointName = None  # type: ignore[assignment]  # replaced in __post_init__
    fit: FitName = "robust"
    spread: bool = True
    paper: PaperConfig = PaperConfig()
    predict: PredictConfig = PredictConfig()
    motion_model: CameraModelName = "rigid"

    def __post_init__(self) -> None:
        check_choice("stabilize", self.stabilize, METHODS)
        if self.keypoints is None:
            default: KeypointName = "direct" if self.stabilize == "predict" else "orb"
            object.__setattr__(self, "keypoints", default)
        check_choice("keypoints", self.keypoints, KEYPOINTS)
        check_choice("fit", self.fit, get_args(FitName))
        _check_type(self, "spread", bool, "True or False")
        check_choice("motion_model", self.motion_model, MODELS)
        if self.motion_model == "mesh" and self.keypoints != "direct":
            raise ArgumentError(
                f'motion_model "mesh" is given with keypoints {self.keypoints!r}: use "direct"'
            )
        for name, part in _PARTS.items():
            _check_type(self, name, part, f"a {part.__name__}")

    def __repr__(self) -> str:
        changed = ", ".join(f"{name}={value!r}" for name, value in self.changed_options().items())
        return f"StabilizerConfig({self.stabilize!r})" + f".with_options({changed})" * bool(changed)

    @property
    def border(self) -> int:
        """N of eq. 6, pixels; used by every method that moves frames."""
        return self.paper.border

    def options(self) -> dict[str, Any]:
        """All settings except the method, by the names of the command line and of labels."""
        values: dict[str, Any] = {
            "keypoints": self.keypoints,
            "fit": self.fit,
            "spread": self.spread,
            "motion_model": self.motion_model,
        }
        for name in _PARTS:
            part = getattr(self, name)
            values |= {field.name: getattr(part, field.name) for field in fields(part)}
        return values

    def changed_options(self) -> dict[str, Any]:
        """The `options` that differ from the defaults of this method."""
        defaults = StabilizerConfig(self.stabilize).options()
        return {name: value for name, value in self.options().items() if value != defaults[name]}

    def with_options(self, **values: Any) -> StabilizerConfig:
        """A copy with some options changed, by the names of `options`.

        Raises
        ------
        ArgumentError
            There is no such option, or its value is not valid.
        """
        for name in values:
            check_choice("option", name, tuple(self.options()))
        parts = {
            part: replace(
                getattr(self, part),
                **{
                    field.name: values.pop(field.name)
                    for field in fields(kind)
                    if field.name in values
                },
            )
            for part, kind in _PARTS.items()
        }
        return replace(self, **values, **parts)
