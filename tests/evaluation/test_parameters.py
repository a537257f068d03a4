"""Search parameters: parsing, ties of Table 3, options of `ssiam track`."""

import pytest

from ssiam.errors import ArgumentError
from ssiam.evaluation.parameters import (
    TABLE_3,
    Parameter,
    paper_config,
    paper_values,
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
    ],
)
def test_invalid_parameters_are_refused(text, named):
    with pytest.raises(ArgumentError, match=named):
        Parameter.parse(text)


def test_thresholds_of_y_follow_x_unless_given():
    assert paper_config({"thx1": 80.0}) == StabilizerConfig("paper").with_options(
        thx1=80.0, thy1=40.0
    )
    free = paper_config({"thx1": 80.0, "thy1": 9.0, "tha": 0.30000000000000004})
    assert (free.paper.thx1, free.paper.thy1, free.paper.tha) == (80, 9, 0.3)


def test_the_default_ranges_include_the_papers_values():
    parameters = [Parameter.parse(text) for text in TABLE_3]
    assert paper_config(paper_values(parameters)) == StabilizerConfig("paper")
    assert paper_values([Parameter.parse("thx1=100:120")]) is None


def test_flags_contain_changed_settings():
    assert track_flags(StabilizerConfig("paper")) == "--stabilize paper"
    config = StabilizerConfig("paper").with_options(keypoints="direct", thx1=80.0)
    assert track_flags(config) == "--stabilize paper --keypoints direct --thx1 80.0"


def test_a_parameter_with_choices_has_an_empty_range():
    parameter = Parameter("keypoints", choices=("orb", "direct"))
    assert (parameter.low, parameter.high, parameter.step) == (0.0, 0.0, 1.0)
    assert parameter.holds("orb")
    assert not parameter.holds("gftt")
