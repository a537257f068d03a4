"""A search is the same whether it was interrupted or not, and finds what is best."""

import builtins

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.errors import MissingExtraError, SsiamError
from ssiam.evaluation import tuning
from ssiam.evaluation.bench import Done
from ssiam.evaluation.parameters import Parameter
from ssiam.evaluation.study import TuningError
from ssiam.evaluation.tuning import Search, Tried, tune
from ssiam.stabilize import StabilizerConfig

SEARCHED = tuple(map(Parameter.parse, ("thx2=2:40", "tha=0.01:0.5", "keypoints=gftt,orb")))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=12)


@pytest.fixture(scope="module")
def undisturbed(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed")
    return list(tune(Search(dataset, ("kcf",), SEARCHED, out), 5))


def test_trials_are_counted_and_the_first_has_the_papers_numbers(undisturbed):
    assert [each.number for each in undisturbed] == [1, 2, 3, 4, 5]
    assert undisturbed[0].config == StabilizerConfig("paper")
    assert len({each.config for each in undisturbed}) == 5
    for each in undisturbed:
        assert each.config.paper.thy2 == each.config.paper.thx2 / 2
        assert each.config.paper.thx1 == 60


def test_a_fresh_search_repeats(dataset, tmp_path, undisturbed):
    assert list(tune(Search(dataset, ("kcf",), SEARCHED, tmp_path), 5)) == undisturbed


def test_another_seed_tries_other_values(dataset, tmp_path, undisturbed):
    other = list(tune(Search(dataset, ("kcf",), SEARCHED, tmp_path, seed=100), 2))
    assert other[0] == undisturbed[0]
    assert other[1].config != undisturbed[1].config


@pytest.mark.parametrize("trial", [0, 2], ids=["in the first trial", "in the third"])
def test_an_interrupted_search_goes_on_as_if_nothing_had_been(
    dataset, tmp_path, undisturbed, monkeypatch, trial
):
    search = Search(dataset, ("kcf",), SEARCHED, tmp_path)
    run_all, ended = tuning.run_all, []

    def interrupted(todo, *arguments):
        for done in run_all(todo, *arguments):
            if len(ended) == 4 * trial + 1:  # two runs a trial, told twice
                raise KeyboardInterrupt
            ended.append(done)
            yield done

    monkeypatch.setattr(tuning, "run_all", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(tune(search, 5))
    monkeypatch.undo()
    assert list(tune(search, 5)) == undisturbed


def test_a_search_in_parts_is_the_same(dataset, tmp_path, undisturbed):
    search = Search(dataset, ("kcf",), SEARCHED, tmp_path)
    assert list(tune(search, 2)) == undisturbed[:2]
    assert list(tune(search, 2)) == undisturbed[:2]
    assert list(tune(search, 5)) == undisturbed


def test_a_measure_is_that_of_the_files(dataset, undisturbed, tmp_path):
    first = next(tune(Search(dataset, ("kcf",), SEARCHED, tmp_path), 1))
    assert first == undisturbed[0]
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--trackers", "kcf"]
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*_001.txt")}
    assert len(before) == 2
    assert main([*arguments, "--stabilize", "paper"]) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_what_is_best_is_found(dataset, tmp_path, monkeypatch):
    """Where only THx1 counts, and 90 is best."""

    def told(todo, jobs=1):
        distance = abs(todo[0].entry.config.paper.thx1 - 90)
        yield Done("kcf", "clip0", 10, int(distance // 10), 1 / (1 + distance))

    monkeypatch.setattr(tuning, "run_all", told)
    searched = (Parameter.parse("thx1=20:120"),)
    best = min(tune(Search(dataset, ("kcf",), searched, tmp_path), 30), key=lambda t: t.cost)
    assert abs(best.config.paper.thx1 - 90) <= 5
    assert best.config.paper.thy1 == best.config.paper.thx1 / 2


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        pytest.param((3, 0.01), (4, 0.99), id="a target fewer outweighs any overlap"),
        pytest.param((3, 0.5), (3, 0.4), id="else overlap decides"),
    ],
)
def test_order_of_costs(better, worse):
    config = StabilizerConfig()
    assert Tried(1, config, *better).cost < Tried(1, config, *worse).cost


def test_a_failing_run_is_told_and_its_trial_done_again(tmp_path, undisturbed):
    data = write_dataset(tmp_path / "data", sequences=2, frames=12)
    broken = data / "clip1" / "img" / "0002.jpg"
    content = broken.read_bytes()
    broken.write_bytes(b"")
    search = Search(data, ("kcf",), SEARCHED, tmp_path / "out")
    with pytest.raises(TuningError, match=r"clip1.*0002\.jpg"):
        list(tune(search, 5))
    broken.write_bytes(content)
    assert list(tune(search, 5)) == undisturbed


@pytest.mark.parametrize(
    "content", [b"garbage " * 99, b"SQLite format 3\0" + b"\0" * 4096], ids=["text", "zeros"]
)
def test_a_damaged_study_is_one_line(dataset, tmp_path, content):
    (tmp_path / "study.db").write_bytes(content)
    with pytest.raises(TuningError, match=r"study\.db.*delete it") as caught:
        list(tune(Search(dataset, ("kcf",), SEARCHED, tmp_path), 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("other", "named"),
    [
        pytest.param({"parameters": SEARCHED[:1]}, "parameters", id="parameters"),
        pytest.param({"trackers": ("mil",)}, "trackers", id="trackers"),
        pytest.param({"seed": 1}, "seed", id="seed"),
    ],
)
def test_another_search_in_the_same_folder_is_refused(dataset, tmp_path, other, named):
    same = {"trackers": ("kcf",), "parameters": SEARCHED, "out": tmp_path}
    list(tune(Search(dataset, **same), 1))
    with pytest.raises(TuningError, match=f"other {named}; give another --out"):
        list(tune(Search(dataset, **{**same, **other}), 2))


def test_a_folder_that_cannot_be_made(dataset, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SsiamError, match="file"):
        list(tune(Search(dataset, ("kcf",), SEARCHED, tmp_path / "file" / "out"), 1))


def test_without_optuna_the_extra_is_named(dataset, tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **options):
        if name.startswith("optuna"):
            raise ImportError(name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"ssiam\[bench\]"):
        list(tune(Search(dataset, ("kcf",), SEARCHED, tmp_path), 1))
