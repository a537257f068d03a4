import pytest

from ssiam import StabilizerConfig


@pytest.mark.parametrize("method", ["predict", "paper", "literal", "off"])
def test_keypoints_unless_given_are_the_methods_own(method):
    own = "direct" if method == "predict" else "orb"
    assert StabilizerConfig(method).keypoints == own
    assert StabilizerConfig(method, keypoints="gftt").keypoints == "gftt"


@pytest.mark.parametrize(
    "values", [{"memory": 1.0}, {"memory": -0.1}, {"smoothing": 1.0}, {"margin": -0.1}]
)
def test_bad_settings_are_named(values):
    (name,) = values
    with pytest.raises(ValueError, match=f"{name} is"):
        StabilizerConfig(**values)
