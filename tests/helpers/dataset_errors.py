"""Error messages of damaged datasets."""

from __future__ import annotations

import pytest

from ssiam.datasets import open_dataset
from ssiam.errors import SsiamError


def error_line(path, *args, **kwargs):
    """The message of the error raised by opening a dataset and reading all its sequences."""
    with pytest.raises(SsiamError) as caught:
        dict(open_dataset(path, *args, **kwargs).sequences)
    line = str(caught.value)
    assert "\n" not in line
    return line
