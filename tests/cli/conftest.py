"""Inputs shared by several test files; no test writes into them."""

import pytest

from helpers.shaky_dataset import write_dataset
from helpers.tracked_clip import write_clip


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip.mp4"
    return path, write_clip(path)


@pytest.fixture(scope="session")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=10)
