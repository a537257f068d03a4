"""Hypothesis strategies for regions."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

BOUNDS = (64, 48)

# Coordinates mostly within BOUNDS, some outside, pixels.
COORDINATES = st.floats(-40, 100, allow_nan=False, width=32)
POLYGONS = arrays(np.float64, (1, 8), elements=COORDINATES)
BOXES = st.tuples(st.floats(5, 30), st.floats(5, 20), st.floats(2, 25), st.floats(2, 20)).map(
    lambda box: np.array([box])
)
