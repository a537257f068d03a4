import numpy as np
import pytest

from helpers.stub_networks import fixed_maps
from ssiam.trackers.anchors import anchor_boxes, cell_of, decode, response_side
from ssiam.trackers.siamese import foreground_probability


@pytest.mark.parametrize(("instance", "base", "side"), [(255, 8, 25), (287, 0, 21), (831, 8, 97)])
def test_response_map_sides(instance, base, side):
    assert response_side(instance, base) == side


@pytest.mark.parametrize("side", [25, 21])
def test_anchors_are_the_reference(golden, side):
    expected = golden("loops/functions.npz")[f"anchors_{side}"].T
    np.testing.assert_array_equal(anchor_boxes(side), expected)


def test_decoding_is_the_reference(golden):
    z = golden("loops/functions.npz")
    cls, loc = fixed_maps(25)(None)
    boxes = decode(loc, anchor_boxes(25))[:, ::7]
    np.testing.assert_allclose(boxes, z["convert_bbox_1"], rtol=2e-7, atol=1e-6)
    np.testing.assert_allclose(foreground_probability(cls)[::7], z["convert_score_1"], atol=1e-6)


def test_decoding_inverts_the_paper():
    """Eq. 12 of SiamRPN: decoding the regression targets of a box returns the box."""
    anchors = anchor_boxes(25)
    box = np.array([13.0, -20.0, 71.0, 44.0])[:, None]
    center, size = anchors[:2], anchors[2:]
    loc = np.concatenate([(box[:2] - center) / size, np.log(box[2:] / size)])
    boxes = decode(loc.reshape(1, 20, 25, 25).astype(np.float32), anchors)
    np.testing.assert_allclose(boxes, np.broadcast_to(box, boxes.shape), atol=1e-4)


def test_anchors_are_centered_on_their_cells():
    anchors = anchor_boxes(25)
    for index in (0, 1, 25, 624, 625, 2788, 3124):
        row, column = cell_of(index, 25)
        assert tuple(anchors[:2, index]) == ((column - 12) * 8, (row - 12) * 8)
