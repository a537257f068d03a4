"""`near_prediction`: candidates are ranked lower the farther they are from the predicted position.

A look-alike that moves otherwise than the target is not where the target can be expected, however
well it matches the template. How far is far follows from how well the last positions were
predicted. (In a map of scores alone, the cosine window plays this role, with one width for all.)
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from ssiam.geometry import XYWH
from ssiam.trackers.responses import Response

# Distance, in target sizes, at which a rank is halved: a constant, and a multiple of the recent
# error of the predictions. Chosen with benchmarks/calibration/position_prior.py.
_HALVING: Final = 0.5
_HALVING_PER_ERROR: Final = 10.0


def near_prediction(response: Response, stab_xywh: XYWH, error: float) -> Response:
    """The response with each rank divided by 1 + (distance / halving distance)².

    Ranks fall off slowly, as those of Student's t distribution: a prediction may also be wrong.

    Parameters
    ----------
    response : Response
    stab_xywh : (x, y, w, h)
        The predicted box, view pixels.
    error : float
        Recent error of the predictions, target sizes.
    """
    x, y, w, h = stab_xywh
    dx, dy = response.boxes[0] - (x + w / 2), response.boxes[1] - (y + h / 2)
    halving = _HALVING + _HALVING_PER_ERROR * error
    relative = (dx * dx + dy * dy) / (w * h * halving**2)
    return replace(response, ranked=response.ranked / (1 + relative))
