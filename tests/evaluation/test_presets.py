"""Presets of the paper's tables, and parsing of labels."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ssiam.errors import ArgumentError
from ssiam.evaluation.paper.presets import PRESETS, THRESHOLDS, preset
from ssiam.evaluation.paper.published import TABLE3
from ssiam.evaluation.paper.summary import parse_label
from ssiam.evaluation.runs.entries import Entry
from ssiam.motion import KEYPOINTS
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import METHODS, StabilizerConfig

PAPER = StabilizerConfig("paper")


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty folder of imported weights."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "cache" / "ssiam" / "weights"


@pytest.mark.parametrize(
    ("name", "count"), [("table1", 2), ("table2", 7), ("table3", 12), ("table4", 2)]
)
def test_each_configuration_occurs_once(name, count):
    labels = [each.label for each in preset(name, ["kcf"], {}).entries]
    assert len(set(labels)) == len(labels) == count


def test_table2_has_all_generators():
    configs = [each.config for each in preset("table2", ["kcf"], {}).entries]
    assert configs[0].stabilize == "off"
    assert {each.keypoints for each in configs[1:]} == set(KEYPOINTS)


def test_table3_varies_one_threshold_at_a_time_and_keeps_the_ties():
    configs = [each.config for each in preset("table3", ["kcf"], {}).entries]
    assert PAPER in configs
    for config in configs:
        assert (config.paper.thx1, config.paper.thx2) == (
            2 * config.paper.thy1,
            2 * config.paper.thy2,
        )
        changed = [n in config.changed_options() for n in ("thx1", "thx2", "tha")]
        assert sum(changed) <= 1
    assert {each.paper.thx1 for each in configs} == {60, 80, 100}
    assert {each.paper.thx2 for each in configs} == {20, 40, 80}
    for unit in ("rad", "deg"):
        angles = {each.paper.tha for each in configs if each.paper.tha_unit == unit}
        assert angles == {0.1, 0.3, 0.5, 1.0}


@pytest.mark.parametrize("name", PRESETS)
def test_default_trackers_need_no_weights_or_have_them(name):
    weights = {"nanotrack_v2": Path("two")}
    entries = preset(name, None, weights).entries
    assert {each.tracker for each in entries} == {"csrt", "kcf", "nanotrack_v2"}
    assert all(each.weights == weights.get(each.tracker) for each in entries)


def test_imported_weights_are_used(store):
    (store / "siamfc").mkdir(parents=True)
    assert len(preset("table1", None, {}).missing) == 3  # of an import that failed
    (store / "siamfc" / "network.json").touch()
    found = preset("table1", None, {})
    assert [each.label for each in found.entries if each.tracker == "siamfc"] == [
        "siamfc-off",
        "siamfc-paper",
    ]
    assert [line.split(":")[0] for line in found.missing] == ["SiamRPN++", "SiamMask_E"]
    (line,) = preset("table1", ["siammask_e", "siamrpn_r50_l234_dwxcorr"], {}).missing
    assert line == "SiamFC: its weights are here; add siamfc to --trackers"


def test_missing_weights_come_with_their_command():
    siamfc, siamrpn, siammask = preset("table1", None, {}).missing
    assert siamfc == "SiamFC: ssiam weights get siamfc"
    for line, name in ((siamrpn, "siamrpn_r50_l234_dwxcorr"), (siammask, "siammask_e")):
        assert "get model.pth at https://drive.google.com/drive/folders/" in line
        assert line.endswith(f", then: ssiam weights import model.pth --tracker {name}")


def test_one_line_for_each_missing_tracker_and_dataset():
    missing = preset("table1", ["kcf"], {}, ["vot-2018", "OTB100"]).missing
    assert [line.split(":")[0] for line in missing] == [
        "SiamFC",
        "SiamRPN++",
        "SiamMask_E",
        "VOT2016",
        "VOT2019",
    ]
    assert all("\n" not in line for line in missing)


@pytest.mark.parametrize(
    ("name", "datasets", "count"),
    [
        pytest.param("table2", ["OTB100"], 4, id="not a VOT dataset"),
        pytest.param("table2", ["VOT2019"], 4, id="not the year of Table 2"),
        pytest.param("table3", ["VOT2018"], 3, id="the year of Table 3"),
        pytest.param("table4", ["VOT2019"], 4, id="not the year of Table 4"),
        pytest.param("table4", None, 3, id="datasets not given"),
    ],
)
def test_missing_data(name, datasets, count):
    assert len(preset(name, ["kcf"], {}, datasets).missing) == count


def test_unknown_names_are_refused():
    with pytest.raises(ArgumentError, match="table9"):
        preset("table9", None, {})
    with pytest.raises(ArgumentError, match="magic"):
        preset("table1", ["magic"], {})


configs = st.builds(
    lambda stabilize, **values: StabilizerConfig(stabilize).with_options(**values),
    stabilize=st.sampled_from(METHODS),
    keypoints=st.sampled_from(KEYPOINTS),
    fit=st.sampled_from(("robust", "least_squares")),
    window=st.integers(1, 99),
    gate=st.floats(0, 1),
    thx1=st.floats(0, 1e9),
    tha=st.floats(0, 1e-6),
    tha_unit=st.sampled_from(("rad", "deg")),
)


@settings(deadline=None)
@given(configs, st.sampled_from(("kcf", "nanotrack_v3")))
def test_labels_round_trip(config, tracker):
    assert parse_label(Entry(tracker, config).label) == (tracker, config)


@pytest.mark.parametrize(
    "label", ["model_SiamMask", "", "-off", "kcf-magic", "kcf-paper-thx1=x", "kcf-paper-what=1"]
)
def test_other_names_are_not_labels(label):
    assert parse_label(label) is None


def labels(name):
    return [each.label.removeprefix("kcf-") for each in preset(name, ["kcf"], {}).entries]


def test_configurations_of_each_table_in_order():
    assert labels("table1") == labels("table4") == ["off", "paper"]
    assert labels("table2") == [
        "off",
        "paper",
        *(f"paper-keypoints={name}" for name in ("gftt", "harris", "brisk", "mser", "direct")),
    ]
    assert labels("table3") == [
        "paper",
        "paper-thx1=80.0-thy1=40.0",
        "paper-thx1=100.0-thy1=50.0",
        "paper-thx2=40.0-thy2=20.0",
        "paper-thx2=80.0-thy2=40.0",
        *(f"paper-tha={angle}" for angle in (0.1, 0.5, 1.0)),
        *(f"paper-tha={angle}-tha_unit=deg" for angle in (0.1,)),
        "paper-tha_unit=deg",
        *(f"paper-tha={angle}-tha_unit=deg" for angle in (0.5, 1.0)),
    ]


def test_rows_of_table_3_have_the_value_that_they_name():
    attributes = {"THx1": "thx1", "THx2": "thx2", "THa,": "tha"}
    for name, row in THRESHOLDS.items():
        for value, config in row.items():
            assert getattr(config.paper, attributes[name[:4]]) == value
    assert {name.partition(",")[0] for name in THRESHOLDS} == set(TABLE3)
    units = {
        name: {each.paper.tha_unit for each in row.values()} for name, row in THRESHOLDS.items()
    }
    assert (units["THa, rad"], units["THa, degrees"]) == ({"rad"}, {"deg"})


def test_runtime_options_apply_to_networks():
    options = RuntimeOptions("onnxruntime", 3)
    entries = preset("table1", ["kcf", "siamfc"], {"siamfc": Path("w")}, None, options).entries
    assert [each.label for each in entries] == [
        "kcf-off-threads=3",
        "kcf-paper-threads=3",
        "siamfc-off-runtime=onnxruntime-threads=3",
        "siamfc-paper-runtime=onnxruntime-threads=3",
    ]
    assert [each.weights for each in entries] == [None, None, Path("w"), Path("w")]


@pytest.mark.parametrize(
    ("name", "years"),
    [("table1", (2016, 2018, 2019)), *((f"table{n}", (2018,)) for n in (2, 3, 4))],
)
def test_the_datasets_of_each_table(name, years):
    missing = preset(name, ["kcf"], {}, []).missing[3:]
    assert missing == [
        f"VOT{year}: not among the datasets; download it from votchallenge.net" for year in years
    ]
