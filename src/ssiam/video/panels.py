"""`side_by_side`: the raw and the steadied picture next to each other."""

from __future__ import annotations

import cv2
import numpy as np

from ssiam.geometry import Image
from ssiam.video.lettering import WHITE, Lettering

LABELS = ("raw", "steadied")


def side_by_side(raw: Image, steadied: Image) -> Image:
    """Two panels of the size of `raw`, (H, 2 W, 3) uint8 BGR, labelled "raw" and "steadied".

    A steadied picture of another size is scaled to fit its panel; its shape is kept, and black
    fills the rest. Both inputs stay as they are.
    """
    size_wh = raw.shape[1], raw.shape[0]
    panels = [raw.copy(), fitted(steadied, size_wh)]
    for panel, label in zip(panels, LABELS, strict=True):
        lettering = Lettering.for_image(panel)
        lettering.write(panel, label, (lettering.gap, lettering.gap + lettering.line_height), WHITE)
    return np.hstack(panels)


def fitted(image: Image, size_wh: tuple[int, int]) -> Image:
    """A copy scaled to fit into `size_wh` (width, height), centred on black."""
    width, height = size_wh
    rows, columns = image.shape[:2]
    if (columns, rows) == size_wh:
        return image.copy()
    scale = min(width / columns, height / rows)
    inner_w, inner_h = max(1, round(columns * scale)), max(1, round(rows * scale))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    panel = np.zeros((height, width, 3), dtype=np.uint8)
    left, top = (width - inner_w) // 2, (height - inner_h) // 2
    panel[top : top + inner_h, left : left + inner_w] = cv2.resize(
        image, (inner_w, inner_h), interpolation=how
    )
    return panel
