"""How far the view turns and how fast a target in doubt slows down, on held-out videos.

    python benchmarks/calibration/prediction.py DAVIS [--clips FOLDER ...] [--trackers lite ...]
        [--max-turn 0.1 ...] [--speed-loss 0.5 ...] [--frames 50]

DAVIS is the folder of JPEGImages and Annotations (480p); of it the ten videos that lite was not
trained on (`--videos`) are tracked with predict. Mean overlap

* as they are, and shaken by roll and by white noise,
* "spin": the frame turns by a degree in each frame,
* "orbit": the scene turns, and the target stays upright, as in footage of a camera that circles it.

The clips, in MOTChallenge's layout, show moving targets; each is tracked for up to 70 frames, and
after a start of 20 frames it is hidden behind what is beside it for 6 and for 12 frames. By default
they are ADL-Rundle-6 of the folder of test data, on which nothing is reported.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import islice, product
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.datasets import Shake, VideoSequence, open_dataset, shaken
from ssiam.geometry import Image, iou, mask_bounds
from ssiam.stabilize import predictor

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.masks import HELD_OUT, box, true_mask
from benchmarks.common.data import MOT, read_bgr
from benchmarks.common.loading import load
from benchmarks.common.tables import line
