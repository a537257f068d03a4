"""Searches: same result after an interruption, and the optimum of a known cost."""

import builtins
import functools
from dataclasses import replace

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.errors import ArgumentError, MissingExtraError, SsiamError
from ssiam.evaluation import tuning
from ssiam.evaluation.paper.summary import parse_label
from ssiam.evaluation.parameters import Parameter
from ssiam.evaluation.runs.bench import TaskResult
from ssiam.evaluation.runs.entries import Entry
from ssiam.evaluation.tuning import FinishedTrial, Search, TrialError, TuningError, tune
from ssiam.runtime import RuntimeOptions
from ssiam.runtime.files import weights_sha256
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers.lite import SHIPPED

paper_search = functools.partial(Search, stabilize="paper")
SEARCHED = tuple(map(Parameter.parse, ("thx2=2:40", "tha=0.01:0.5", "keypoints=gftt,orb")))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=12)


@pytest.fixture(scope="module")
def uninterrupted(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    return list(tune(paper_search(dataset, ("kcf",), SEARCHED, out), 5))


def test_trials_are_numbered_and_the_first_has_the_papers_values(uninterrupted):
    assert [each.number for each in uninterrupted] == [1, 2, 3, 4, 5]
    assert uninterrupted[0].config == StabilizerConfig("paper")
    assert len({each.config for each in uninterrupted}) == 5
    for each in uninterrupted:
        assert each.config.paper.thy2 == each.config.paper.thx2 / 2
        assert each.config.paper.thx1 == 60


def test_a_new_search_gives_the_same_trials(dataset, tmp_path, uninterrupted):
    assert list(tune(paper_search(dataset, ("kcf",), SEARCHED, tmp_path), 5)) == uninterrupted


def test_another_seed_tries_other_values(dataset, tmp_path, uninterrupted):
    other = list(tune(paper_search(dataset, ("kcf",), SEARCHED, tmp_path, seed=100), 2))
    assert other[0] == uninterrupted[0]
    assert other[1].config != uninterrupted[1].config


@pytest.mark.parametrize("trial", [0, 2], ids=["in the first trial", "in the third"])
def test_an_interrupted_search_gives_the_same_trials(
    dataset, tmp_path, uninterrupted, monkeypatch, trial
):
    search = paper_search(dataset, ("kcf",), SEARCHED, tmp_path)
    run_all, ended = tuning.run_all, []

    def interrupted(todo, *arguments):
        for done in run_all(todo, *arguments):
            if len(ended) == 4 * trial + 1:  # two runs per trial, each yielded twice
                raise KeyboardInterrupt
            ended.append(done)
            yield done

    monkeypatch.setattr(tuning, "run_all", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(tune(search, 5))
    monkeypatch.undo()
    assert list(tune(search, 5)) == uninterrupted


def test_a_search_in_several_calls_gives_the_same_trials(dataset, tmp_path, uninterrupted):
    search = paper_search(dataset, ("kcf",), SEARCHED, tmp_path)
    assert list(tune(search, 2)) == uninterrupted[:2]
    assert list(tune(search, 2)) == uninterrupted[:2]
    assert list(tune(search, 5)) == uninterrupted


def test_the_runs_are_those_of_bench(dataset, uninterrupted, tmp_path):
    first = next(tune(paper_search(dataset, ("kcf",), SEARCHED, tmp_path), 1))
    assert first == uninterrupted[0]
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--trackers", "kcf"]
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*_001.txt")}
    assert len(before) == 2
    assert main([*arguments, "--stabilize", "paper"]) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_the_settings_of_predict_are_searched(dataset, tmp_path):
    searched = tuple(map(Parameter.parse, ("margin=0:0.5", "turn=true,false", "memory=0:0.95")))
    search = Search(dataset, ("kcf",), searched, tmp_path)
    trials = list(tune(search, 4))
    assert trials[0].config == StabilizerConfig()
    assert len({each.config for each in trials}) == 4
    assert {each.config.stabilize for each in trials} == {"predict"}
    assert {each.config.paper for each in trials} == {StabilizerConfig().paper}
    assert not all(each.config.predict.turn for each in trials)
    labels = {path.name for path in tmp_path.iterdir() if path.is_dir()}
    assert {parse_label(label) for label in labels} == {("kcf", each.config) for each in trials}
    assert list(tune(Search(dataset, ("kcf",), searched, tmp_path), 4)) == trials


@pytest.mark.parametrize(
    ("method", "text", "named"),
    [
        ("predict", "thx1=20:120", "thx1=20:120: is not a setting of predict; .* paper to search"),
        ("paper", "margin=0:0.5", "margin=0:0.5: is not a setting of paper; .* predict to search"),
    ],
)
def test_settings_of_another_method_are_refused(dataset, tmp_path, method, text, named):
    with pytest.raises(ArgumentError, match=named):
        Search(dataset, ("kcf",), (Parameter.parse(text),), tmp_path, stabilize=method)


def test_the_optimum_is_found(dataset, tmp_path, monkeypatch):
    """The cost depends only on THx1, with its optimum at 90."""

    def results(todo, jobs=1):
        distance = abs(todo[0].entry.config.paper.thx1 - 90)
        yield TaskResult("kcf", "clip0", 10, int(distance // 10), 1 / (1 + distance))

    monkeypatch.setattr(tuning, "run_all", results)
    searched = (Parameter.parse("thx1=20:120"),)
    best = min(tune(paper_search(dataset, ("kcf",), searched, tmp_path), 30), key=lambda t: t.cost)
    assert abs(best.config.paper.thx1 - 90) <= 5
    assert best.config.paper.thy1 == best.config.paper.thx1 / 2


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        pytest.param((3, 0.01), (4, 0.99), id="fewer lost targets outweigh any overlap"),
        pytest.param((3, 0.5), (3, 0.4), id="overlap decides between equals"),
    ],
)
def test_order_of_costs(better, worse):
    config = StabilizerConfig()
    assert FinishedTrial(1, config, *better).cost < FinishedTrial(1, config, *worse).cost


def test_a_failed_run_is_an_error_and_its_trial_is_repeated(tmp_path, uninterrupted):
    data = write_dataset(tmp_path / "data", sequences=2, frames=12)
    broken = data / "clip1" / "img" / "0002.jpg"
    content = broken.read_bytes()
    broken.write_bytes(b"")
    search = paper_search(data, ("kcf",), SEARCHED, tmp_path / "out")
    with pytest.raises(TuningError, match=r"clip1.*0002\.jpg"):
        list(tune(search, 5))
    broken.write_bytes(content)
    assert list(tune(search, 5)) == uninterrupted


@pytest.mark.parametrize(
    "content", [b"garbage " * 99, b"SQLite format 3\0" + b"\0" * 4096], ids=["text", "zeros"]
)
def test_a_damaged_study_is_an_error(dataset, tmp_path, content):
    (tmp_path / "study.db").write_bytes(content)
    with pytest.raises(TuningError, match=r"study\.db.*delete it") as caught:
        list(tune(paper_search(dataset, ("kcf",), SEARCHED, tmp_path), 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("other", "named"),
    [
        pytest.param({"parameters": SEARCHED[:1]}, "parameters", id="parameters"),
        pytest.param({"trackers": ("mil",)}, "trackers", id="trackers"),
        pytest.param({"seed": 1}, "seed", id="seed"),
        pytest.param({"stabilize": "literal"}, "stabilize", id="method"),
        pytest.param(
            {"seed": 1, "stabilize": "literal"}, "seed and stabilize", id="seed and method"
        ),
    ],
)
def test_another_search_in_the_same_folder_is_refused(dataset, tmp_path, other, named):
    same = {"trackers": ("kcf",), "parameters": SEARCHED, "out": tmp_path}
    list(tune(paper_search(dataset, **same), 1))
    with pytest.raises(TuningError, match=f"other {named}; give another --out"):
        list(tune(paper_search(dataset, **{**same, **other}), 2))


def test_a_folder_that_cannot_be_created(dataset, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SsiamError, match="file"):
        list(tune(paper_search(dataset, ("kcf",), SEARCHED, tmp_path / "file" / "out"), 1))


def test_missing_optuna_names_the_extra(dataset, tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **options):
        if name.startswith("optuna"):
            raise ImportError(name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"ssiam\[bench\]"):
        list(tune(paper_search(dataset, ("kcf",), SEARCHED, tmp_path), 1))


def test_what_identifies_a_search(dataset, tmp_path):
    options = RuntimeOptions(threads=3)
    search = Search(dataset, ("kcf",), (Parameter.parse("margin=0:0.5"),), tmp_path, seed=4)
    identity = {
        "trackers": ["kcf"],
        "parameters": ["margin=0:0.5"],
        "sequences": ["clip0", "clip1"],
        "seed": 4,
        "runtime": {},
        "weights": {},
        "stabilize": "predict",
    }
    assert tuning._identity(search) == identity
    search = replace(search, options=options, seed=0)
    assert tuning._identity(search) == {**identity, "seed": 0, "runtime": {"threads": 3}}
    lite = replace(search, trackers=("lite", "kcf"), weights={"lite": SHIPPED})
    assert tuning._identity(lite)["weights"] == {"lite": weights_sha256(SHIPPED)}
    assert tuning._entries(lite, StabilizerConfig("off"))[0] == Entry(
        "lite", StabilizerConfig("off"), SHIPPED, options
    )
    defaults = Search(dataset, ("kcf",), (), tmp_path)
    assert (defaults.weights, defaults.seed, defaults.stabilize) == ({}, 0, "predict")
    assert defaults.options == RuntimeOptions()


def test_the_overlap_of_a_trial_is_the_mean_of_its_runs(dataset, tmp_path, monkeypatch):
    search = paper_search(dataset, ("kcf",), (), tmp_path)

    def of(*overlaps):
        results = [TaskResult("kcf", "s", 9, 2, each) for each in overlaps]
        monkeypatch.setattr(tuning, "run_all", lambda *given: results)
        return tuning._measured(search, StabilizerConfig("paper"), 1)

    assert of(0.5, 0.25, float("nan")) == (6, 0.375)
    assert of(float("nan")) == (2, 0)


def test_a_trial_with_a_failed_run_says_how_many(dataset, tmp_path, monkeypatch):
    search = paper_search(dataset, ("kcf",), (), tmp_path)
    good, bad = (
        TaskResult("kcf-paper", "clip0", 9, 2, 0.5),
        TaskResult("kcf-paper", "clip1", failed="no"),
    )
    monkeypatch.setattr(tuning, "run_all", lambda *given: [good, bad])
    with pytest.raises(TrialError, match=r"1 of the 2 runs .* The first: kcf-paper on clip1: no"):
        tuning._measured(search, StabilizerConfig("paper"), 1)
    monkeypatch.setattr(tuning, "run_all", lambda *given: [bad, bad])
    with pytest.raises(TuningError, match=r"^kcf-paper on clip1: no$"):
        tuning._measured(search, StabilizerConfig("paper"), 1)
