"""Search parameters: parsing, ties of Table 3, options of `ssiam track`."""

import pytest

from ssiam.errors import ArgumentError
from ssiam.evaluation.parameters import (
    SEARCH_SPACES,
    Parameter,
    check_method,
    default_values,
    is_whole,
    searched_config,
    track_flags,
)
from ssiam.stabilize import StabilizerConfig


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("thx1=20:120", Parameter("thx1", 20, 120, 1)),
        ("thx1=20:40.5", Parameter("thx1", 20, 40, 1)),
        ("tha=0.05:0.3", Parameter("tha", 0.05, 0.3, 0.01)),
        ("window=5:60", Parameter("window", 5, 60, 1)),
        ("keypoints=orb, direct", Parameter("keypoints", choices=("orb", "direct"))),
        ("memory=0:0.95", Parameter("memory", 0, 0.95, 0.01)),
        ("turn=true,false", Parameter("turn", choices=("true", "false"))),
    ],
)
def test_parameters_are_parsed(text, expected):
    assert Parameter.parse(text) == expected


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("magic=1:2", "unknown parameter 'magic'"),
        ("stabilize=off", "unknown parameter 'stabilize'"),
        ("thx1", "'thx1'"),
        ("thx1=5", "low:high"),
        ("thx1=9:5", "'thx1=9:5'"),
        ("thx1=nan:5", "'thx1=nan:5'"),
        ("thx1=-5:5", "-5"),
        ("thx1=5:5.5", "wider"),
        ("window=0:5", "window"),
        ("window=1.5:5", "whole"),
        ("keypoints=orb,magic", "magic"),
        ("memory=0:1", "memory is 1.0"),
        ("turn=0:1", "unknown turn '0:1'"),
    ],
)
def test_invalid_parameters_are_refused(text, named):
    with pytest.raises(ArgumentError, match=named):
        Parameter.parse(text)


def test_thresholds_of_y_follow_x_unless_given():
    assert searched_config("paper", {"thx1": 80.0}) == StabilizerConfig("paper").with_options(
        thx1=80.0, thy1=40.0
    )
    free = searched_config("paper", {"thx1": 80.0, "thy1": 9.0, "tha": 0.30000000000000004})
    assert (free.paper.thx1, free.paper.thy1, free.paper.tha) == (80, 9, 0.3)


@pytest.mark.parametrize("method", SEARCH_SPACES)
def test_the_default_ranges_include_the_default_values(method):
    parameters = [Parameter.parse(text) for text in SEARCH_SPACES[method]]
    values = default_values(method, parameters)
    assert searched_config(method, values) == StabilizerConfig(method)


def test_default_values_outside_of_a_range():
    assert default_values("paper", [Parameter.parse("thx1=100:120")]) is None
    assert default_values("predict", [Parameter.parse("turn=false")]) is None
    assert default_values("predict", [Parameter.parse("turn=false,true")]) == {"turn": "true"}
    assert default_values("predict", [Parameter.parse("keypoints=orb,direct")]) == {
        "keypoints": "direct"
    }


def test_switches_are_settings_and_options_of_track():
    config = searched_config("predict", {"turn": "false", "margin": 0.25, "speed": "true"})
    assert config == StabilizerConfig().with_options(turn=False, margin=0.25)
    assert track_flags(config) == "--stabilize predict --no-turn --margin 0.25"


def test_flags_contain_changed_settings():
    assert track_flags(StabilizerConfig("paper")) == "--stabilize paper"
    config = StabilizerConfig("paper").with_options(keypoints="direct", thx1=80.0)
    assert track_flags(config) == "--stabilize paper --keypoints direct --thx1 80.0"


def test_a_parameter_with_choices_has_an_empty_range():
    parameter = Parameter("keypoints", choices=("orb", "direct"))
    assert (parameter.low, parameter.high, parameter.step) == (0.0, 0.0, 1.0)
    assert parameter.holds("orb")
    assert not parameter.holds("gftt")


@pytest.mark.parametrize(
    ("name", "step"),
    [
        *((name, 1.0) for name in ("window", "border", "thx1", "thy1", "thx2", "thy2")),
        *((name, 0.01) for name in ("gate", "tha", "shake", "memory", "smoothing", "margin")),
    ],
)
def test_steps_of_each_setting(name, step):
    high = 3 if step == 1 else 0.5
    found = Parameter.parse(f"{name}=1:{high}" if step == 1 else f"{name}=0.1:{high}")
    assert found.step == step
    assert found.high == high
    assert is_whole(name) == (name in ("window", "border"))


def test_the_end_of_a_range_is_a_whole_number_of_steps():
    assert Parameter.parse("margin=0.1:0.355").high == 0.35
    assert Parameter.parse("margin=0:0.3").high == 0.3
    assert Parameter.parse("thx1=0.5:3").high == 2.5
    with pytest.raises(ArgumentError, match=r"in steps of 0\.01; give a wider range"):
        Parameter.parse("margin=0.1:0.105")


def test_ends_belong_to_a_range():
    parameter = Parameter("thx1", 20, 40)
    assert [parameter.holds(value) for value in (19, 20, 40, 41)] == [False, True, True, False]
    assert str(parameter) == "thx1=20:40"
    assert str(Parameter("turn", choices=("true", "false"))) == "turn=true,false"


def test_search_spaces_by_default():
    table_3 = ("thx1=20:120", "thx2=5:100", "tha=0.05:1")
    assert {
        "predict": ("memory=0:0.95", "smoothing=0:0.95", "margin=0:0.5"),
        "paper": table_3,
        "literal": table_3,
    } == SEARCH_SPACES


def test_the_border_is_a_setting_of_every_method():
    for method in ("predict", "paper", "literal"):
        check_method([Parameter("border", 0, 9), Parameter("keypoints")], method)
    for name in ("window", "thx1", "judge", "tha_unit"):
        with pytest.raises(ArgumentError, match="give --stabilize paper"):
            check_method([Parameter(name)], "predict")
    for name in ("choose", "find", "memory"):
        with pytest.raises(ArgumentError, match="give --stabilize predict"):
            check_method([Parameter(name)], "literal")
