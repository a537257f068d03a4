"""Damaged inputs raise a `SsiamError` or nothing; some seconds of what `make fuzz` does."""

from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip("torch")
pytest.importorskip("pymavlink")
pytest.importorskip("onnxruntime")
pytest.importorskip("trax")

from fuzz.mutations import mutated
from fuzz.target import failure
from fuzz.targets import all_targets

CORPUS = Path(__file__).parent / "corpus"
STRETCHED_BYTES = 250_000
# Target, index of its seed, the place in it, and what is repeated there. With a search that starts
# again at each character, each of these would take minutes.
STRETCHED = (
    ("MOT seqinfo", 0, b"imH", b" "),
    ("playlist", 0, b"#EXTM3U", b"\n"),
    ("playlist", 1, b"version 1.0\n", b"\n"),
    ("playlist", 1, b"file clip", b" "),
    ("checkpoint", 1, b"ccollection", b","),
    ("TraX", 0, b'@@TRAX:initialize "', b'\\"'),
    ("gyro log", 1, b"gyroADC[0]", b" "),
)


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    found = {target.name: target for target in all_targets(tmp_path_factory.mktemp("fuzz"))}
    yield found
    for target in found.values():
        target.close()


@settings(
    derandomize=True,
    max_examples=150,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
@given(number=st.integers(0, 2**32), position=st.integers(0, 2**16))
def test_damaged_inputs(targets, number, position):
    random, quick = Random(number), [each for each in targets.values() if each.share > 1]
    target = quick[position % len(quick)]
    data = mutated(random, random.choice(target.seeds))
    error = failure(target, data)
    assert error is None, f"{target.name}: {error!r} for {data[:200]!r}"


def test_valid_inputs(targets):
    for target in targets.values():
        for seed in target.seeds:
            assert failure(target, seed) is None, target.name


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*")), ids=lambda path: path.name)
def test_inputs_that_were_found(targets, path):
    target = targets[path.name.partition("--")[0]]
    assert failure(target, path.read_bytes()) is None


@pytest.mark.parametrize("tail", ["", "as it was"])
@pytest.mark.parametrize(("name", "seed", "after", "repeated"), STRETCHED)
def test_stretched_inputs_are_read_in_linear_time(targets, name, seed, after, repeated, tail):
    valid = targets[name].seeds[seed]
    place = valid.index(after) + len(after)
    rest = valid[place:] if tail else b""
    data = valid[:place] + repeated * (STRETCHED_BYTES // len(repeated)) + rest
    assert failure(targets[name], data) is None
