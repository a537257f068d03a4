"""`with_mask_edges`: a blended track, with the edges of the target's masks in its boxes.

A tracker's box follows the target, but is slow and coarse in its width and height. The mask of the
object in that box has its edges where the object ends, within some pixels, but may contain other
parts than the boxes of the person (a head without its hair, a rider without the bicycle). The
keyframes say which: of several thresholds of the mask's probability, the one is taken whose bounds
fit the keyframes best, the bounds are corrected by their differences there as a tracker's boxes
are, and if even the best ones do not fit, the masks are not used.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.exchange.blending import Blend, Floats, Section, corrected, with_keyframes
from ssiam.geometry import iou

# Mean IoU of a mask's bounds with the keyframes' boxes, from which masks are used, and from which
# they have their largest weight. Chosen on videos of DAVIS, SoccerNet and MOTChallenge.
_LEAST_FIT, _GOOD_FIT = 0.8, 0.85
_MASK_SHARE: Final = 0.5  # largest weight of the masks' edges; the others are the track's


def with_mask_edges(section: Section, track: Blend, bounds: Floats) -> Blend:
    """The track with boxes between its own and those of the masks.

    Parameters
    ----------
    section : Section
    track : Blend
        Of this section.
    bounds : (N, T, 4) float64
        x, y, w, h of the mask of the object in each box of the track, by T thresholds; nan where
        there is no mask.

    Returns
    -------
    Blend
        Keyframes, scores and shares are those of the track.

    Raises
    ------
    ArgumentError
        The bounds are not those of as many frames.
    """
    if bounds.shape[::2] != track.boxes.shape:
        raise ArgumentError(
            f"bounds have shape {bounds.shape}: expected ({len(track.boxes)}, thresholds, 4)"
        )
    keyframes = np.array([each.frame for each in section.keyframes]) - section.first
    fits = [
        float(np.mean(np.nan_to_num(iou(each, track.boxes[keyframes]))))
        for each in np.moveaxis(bounds[keyframes], 1, 0)
    ]
    best = int(np.argmax(fits))
    weight = _MASK_SHARE * np.clip((fits[best] - _LEAST_FIT) / (_GOOD_FIT - _LEAST_FIT), 0, 1)
    has_mask = np.isfinite(bounds[:, best]).all(axis=1, keepdims=True)
    masks = corrected(section, np.where(has_mask, bounds[:, best], track.boxes))
    share = weight * (1 - track.straight_share[:, None]) * has_mask
    boxes = (1 - share) * track.boxes + share * masks
    return replace(track, boxes=with_keyframes(section, boxes))
