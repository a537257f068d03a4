import pytest

from ssiam import StabilizerConfig
from ssiam.stabilize import PaperConfig, PredictConfig


@pytest.mark.parametrize("method", ["predict", "paper", "literal", "off"])
def test_default_keypoints_depend_on_the_method(method):
    default = "direct" if method == "predict" else "orb"
    assert StabilizerConfig(method).keypoints == default
    assert StabilizerConfig(method, keypoints="gftt").keypoints == "gftt"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        pytest.param({"memory": 1.0}, "memory is 1.0", id="share of 1"),
        pytest.param({"memory": -0.1}, "memory is -0.1", id="negative share"),
        pytest.param({"smoothing": 1.0}, "smoothing is 1.0", id="smoothing of 1"),
        pytest.param({"margin": -0.1}, "margin is -0.1", id="negative margin"),
        pytest.param({"window": 0}, "window is 0", id="no frames"),
        pytest.param({"thx1": -1}, "thx1 is -1", id="negative limit"),
        pytest.param({"tha": float("nan")}, "tha is nan", id="nan"),
        pytest.param({"shake": -1}, "shake is -1", id="negative shake"),
        pytest.param({"judge": "eye"}, "unknown judge 'eye'", id="judge"),
        pytest.param({"limits": "none"}, "unknown limits 'none'", id="order of limits"),
        pytest.param({"tha_limits": "x"}, "unknown tha_limits 'x'", id="limited by THa"),
        pytest.param({"tha_unit": "turn"}, "unknown tha_unit 'turn'", id="unit of THa"),
        pytest.param({"thz": 1}, "unknown option 'thz': choose from keypoints, fit", id="unknown"),
    ],
)
def test_invalid_options_are_named(values, message):
    with pytest.raises(ValueError, match=message):
        StabilizerConfig().with_options(**values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"stabilize": "magic"}, "unknown stabilize 'magic'"),
        ({"motion_model": "spline"}, "unknown motion_model 'spline'"),
        (
            {"stabilize": "paper", "motion_model": "mesh"},
            """motion_model "mesh" is given with keypoints 'orb': use "direct\"""",
        ),
        ({"paper": 3}, "paper is 3: it must be a PaperConfig"),
        ({"predict": PaperConfig()}, "predict is PaperConfig.*it must be a PredictConfig"),
    ],
)
def test_invalid_arguments_are_named(values, message):
    with pytest.raises(ValueError, match=message):
        StabilizerConfig(**values)


def test_options_are_the_flat_settings_in_the_order_of_labels():
    assert list(StabilizerConfig().options()) == [
        *("keypoints", "fit", "spread", "motion_model"),
        *("window", "gate", "border", "thx1", "thy1", "thx2", "thy2", "tha"),
        *("judge", "shake", "limits", "tha_limits", "tha_unit"),
        *("choose", "speed", "turn", "trust", "prefer", "find"),
        *("memory", "smoothing", "margin"),
    ]


def test_options_are_set_in_their_part():
    config = StabilizerConfig("paper").with_options(fit="least_squares", border=5, speed=False)
    assert config == StabilizerConfig(
        "paper",
        fit="least_squares",
        paper=PaperConfig(border=5),
        predict=PredictConfig(speed=False),
    )
    assert config.border == 5
    assert config.changed_options() == {"fit": "least_squares", "border": 5, "speed": False}


def test_the_default_keypoints_of_a_method_are_not_a_change():
    assert StabilizerConfig("paper").changed_options() == {}


def test_the_defaults_are_the_papers_or_measured_ones():
    paper = PaperConfig(
        30, 0.1, 20, 60.0, 30.0, 20.0, 10.0, 0.3, "frame", 0.7, "nested", "angle", "rad"
    )
    assert PaperConfig() == paper
    assert PredictConfig() == PredictConfig(True, True, True, True, True, True, 0.8, 0.5, 0.1)
    config = StabilizerConfig()
    assert config == StabilizerConfig(
        "predict", "direct", "robust", True, paper, PredictConfig(), "rigid"
    )


@pytest.mark.parametrize(
    "values",
    [
        {"window": 1},
        {"border": 0},
        dict.fromkeys(("gate", "thx1", "thy1", "thx2", "thy2", "tha", "shake"), 0),
        {"memory": 0, "smoothing": 0, "margin": 0},
        {"memory": 0.999, "smoothing": 0.999},
    ],
)
def test_values_at_the_limits_are_valid(values):
    options = StabilizerConfig().with_options(**values).options()
    assert {name: options[name] for name in values} == values


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"window": 1.5}, "window is 1.5: it must be a whole number"),
        ({"border": 2.0}, "border is 2.0: it must be a whole number"),
        ({"border": -1}, "border is -1: it must not be negative"),
        *(
            ({name: "1"}, f"{name} is '1': it must be a number")
            for name in ("gate", "thx1", "thy1", "thx2", "thy2", "tha", "shake")
        ),
        *(
            ({name: -0.1}, f"{name} is -0.1: it must not be negative")
            for name in ("gate", "thx1", "thy1", "thx2", "thy2", "tha", "shake")
        ),
        *(
            ({name: 1}, f"{name} is 1: it must be True or False")
            for name in ("choose", "speed", "turn", "trust", "prefer", "find", "spread")
        ),
        *(
            ({name: None}, f"{name} is None: it must be a number")
            for name in ("memory", "smoothing", "margin")
        ),
        ({"smoothing": -0.1}, r"smoothing is -0.1: it must be in \[0, 1\)"),
        ({"keypoints": "x"}, "unknown keypoints 'x'"),
        ({"fit": "x"}, "unknown fit 'x'"),
    ],
)
def test_each_wrong_value_is_refused(values, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        StabilizerConfig().with_options(**values)


def test_tha_in_radians():
    assert PaperConfig(tha=0.25).tha_rad == 0.25
    assert PaperConfig(tha=90, tha_unit="deg").tha_rad == pytest.approx(1.5707963)
