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
        ({"paper": 3}, "paper is 3: it must be a PaperConfig"),
        ({"predict": PaperConfig()}, "predict is PaperConfig.*it must be a PredictConfig"),
    ],
)
def test_invalid_arguments_are_named(values, message):
    with pytest.raises(ValueError, match=message):
        StabilizerConfig(**values)


def test_options_are_the_flat_settings_in_the_order_of_labels():
    assert list(StabilizerConfig().options()) == [
        *("keypoints", "fit", "spread"),
        *("window", "gate", "border", "thx1", "thy1", "thx2", "thy2", "tha"),
        *("judge", "shake", "limits", "tha_limits", "tha_unit"),
        *("choose", "speed", "turn", "trust", "find", "memory", "smoothing", "margin"),
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
