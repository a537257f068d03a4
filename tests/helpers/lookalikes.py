"""A target, a look-alike, and stub trackers that see both: red boxes with brightness as score."""

import numpy as np

from helpers.stub_networks import ANCHOR, Stub
from ssiam.trackers import siammask, siamrpn
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.nanotrack import PARAMETERS as NANOTRACK_PARAMETERS
from ssiam.trackers.nanotrack import NanoTrack, NanoTrackNetworks
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks
from ssiam.trackers.siammask import SiamMask, SiamMaskNetworks
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnNetworks

SIZE = (320, 240)  # px
SIDE = 40  # px, of both objects
LEFT, RIGHT = (120, 100), (166, 100)  # px, corners of the target and of the look-alike
CONFUSED = range(8, 10)  # frames in which the look-alike has the higher score
_BRIGHTNESS = 250  # of a score of 1


def frame_with(*objects):
    """A black frame with a red box for each object (x, y, score)."""
    frame = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    for x, y, score in objects:
        frame[y : y + SIDE, x : x + SIDE, 2] = round(_BRIGHTNESS * score)
    return frame


def confusing_frames(count=14):
    """Frames in which a look-alike beside the target is more similar to it for a moment."""
    return [
        frame_with((*LEFT, 0.16 if t in CONFUSED else 0.8), (*RIGHT, 1.0 if t in CONFUSED else 0.3))
        for t in range(count)
    ]


def _maps(crop, red, side, stride):
    """Score (side, side) at each cell of a crop (3, S, S), and the distances of its box's edges.

    Each cell has the brightness of the pixel at its center, and the box of the connected columns
    and rows around it.
    """
    channel = crop[red]
    offsets = (np.arange(side) - side // 2) * stride + (len(channel) - 1) / 2
    cells = np.clip(np.rint(offsets), 0, len(channel) - 1).astype(int)
    score = np.zeros((side, side))
    edges = np.full((4, side, side), 1.0)
    for i, row in enumerate(cells):
        for j, column in enumerate(cells):
            if channel[row, column] < 20:
                continue
            left, right = _run(channel[row], column)
            top, bottom = _run(channel[:, column], row)
            score[i, j] = channel[row, column] / _BRIGHTNESS
            off = max(abs(column - (left + right) / 2), abs(row - (top + bottom) / 2))
            score[i, j] *= np.exp(-8 * (off / (right - left + 1)) ** 2)
            x, y = offsets[j], offsets[i]
            edges[:, i, j] = x - left + 0.5, y - top + 0.5, right + 0.5 - x, bottom + 0.5 - y
    return score, edges


def _run(values, start):
    """First and last index of the bright run of `values` around `start`."""
    low = high = start
    while low > 0 and values[low - 1] > 20:
        low -= 1
    while high < len(values) - 1 and values[high + 1] > 20:
        high += 1
    return low, high


def _logits(score):
    clipped = np.clip(score, 1e-3, 1 - 1e-3)
    return np.log(clipped / (1 - clipped))


def _anchor_search(t, crop, *kernels):
    score, (left, top, right, bottom) = _maps(crop[0], 2, 25, 8)
    cls = np.zeros((1, 10, 25, 25), np.float32)
    cls[:, 5:] = -8
    cls[0, 5 + ANCHOR] = _logits(score)
    loc = np.zeros((1, 20, 25, 25), np.float32)
    loc[0, ANCHOR::5] = (
        (right - left) / 2 / 64,
        (bottom - top) / 2 / 64,
        np.log((left + right) / 64),
        np.log((top + bottom) / 64),
    )
    return [cls, loc]


def _mask_search(t, crop, *kernels):
    shapes = ((1, 1, 25, 25), (1, 1, 125, 125), (1, 1, 63, 63), (1, 1, 31, 31))
    return [*_anchor_search(t, crop), *(np.zeros(shape, np.float32) for shape in shapes)]


def _siamfc_search(t, crops, kernel):
    middle = _logits(_maps(crops[1], 0, 17, 8)[0])
    responses = np.stack([middle - 1, middle, middle - 1])[:, None]
    return [responses.astype(np.float32)]


def _nanotrack_head(t, kernel, crop):
    score, edges = _maps(crop[0], 2, 16, 16)
    logits = np.stack([0 * score, _logits(score)])[None]
    return [logits.astype(np.float32), edges[None].astype(np.float32)]


def _templates():
    return Stub(lambda t, crop: [crop])


def siamrpn_tracker(distractors=False):
    networks = SiamRpnNetworks(_templates(), Stub(_anchor_search))
    parameters = siamrpn.PARAMETERS["siamrpn_r50_l234_dwxcorr"]
    return SiamRpn(networks, parameters, distractors=distractors)


def siammask_tracker(distractors=False):
    refine = Stub(lambda t, *windows: [np.full((1, 127 * 127), -8, np.float32)])
    networks = SiamMaskNetworks(_templates(), Stub(_mask_search), refine)
    return SiamMask(networks, siammask.PARAMETERS["siammask_r50_l3"], distractors=distractors)


def siamfc_tracker(distractors=False):
    networks = SiamFcNetworks(_templates(), Stub(_siamfc_search))
    return SiamFc(networks, distractors=distractors)


def nanotrack_tracker(distractors=False):
    head = Stub(_nanotrack_head)
    head.output_shapes = [(1, 2, 16, 16), (1, 4, 16, 16)]
    networks = NanoTrackNetworks(_templates(), Stub(lambda t, crop: [crop]), head)
    confidence = Confidence((1.0, 0.0), 0.0)
    parameters = NANOTRACK_PARAMETERS["nanotrack_v2"]
    return NanoTrack(networks, parameters, confidence, distractors=distractors)


TRACKERS = {
    "siamfc": siamfc_tracker,
    "siamrpn": siamrpn_tracker,
    "siammask": siammask_tracker,
    "nanotrack": nanotrack_tracker,
}
