"""What damaged datasets are answered with."""

from __future__ import annotations

import pytest

from ssiam.datasets import open_dataset
from ssiam.errors import SsiamError


def answer(path, *args, **kwargs):
    """The one line that opening and reading everything ends with."""
    with pytest.raises(SsiamError) as caught:
        dict(open_dataset(path, *args, **kwargs).sequences)
    line = str(caught.value)
    assert "\n" not in line
    return line
