"""VOT results, and running `ssiam eval` on them."""

import json

import numpy as np

from ssiam.cli import main
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.runs.result_files import vot_path, write_vot

LENGTHS = {"bag": 120, "crossing": 400}
LOST_AT = 40


def truth(length):
    x = 60.0 + np.arange(length)[:, None] / 2
    y = np.full((length, 1), 50.0)
    return np.hstack([x, y, x + 40, y, x + 40, y + 30, x, y + 30])


def dataset(folder, name="VOT2018", lengths=LENGTHS, **changes):
    """Write a dataset as pysot's JSON file, without images."""
    records = {}
    for sequence, length in lengths.items():
        boxes = truth(length).tolist()
        records[sequence] = {
            "video_dir": sequence,
            "init_rect": boxes[0],
            "img_names": [f"{sequence}/color/{n + 1:08d}.jpg" for n in range(length)],
            "gt_rect": boxes,
            "camera_motion": [int(n < 60) for n in range(length)],
            "occlusion": [int(n >= 60) for n in range(length)],
            "width": 320,
            "height": 240,
            **changes,
        }
    path = folder / f"{name}.json"
    path.write_text(json.dumps(records))
    return path


def results(folder, shift=0.0, lost=(), lengths=LENGTHS):
    """Write a tracker's folder: truth moved by `shift` pixels, one loss per sequence in `lost`."""
    for name, length in lengths.items():
        status = np.full(length, Status.TRACKED, np.int8)
        status[0] = Status.INITIALIZED
        if name in lost:
            status[LOST_AT : LOST_AT + 6] = [2, 0, 0, 0, 0, 1]
        regions = np.where(status[:, None] == Status.TRACKED, truth(length) + shift, np.nan)
        write_vot(vot_path(folder, name), Trajectory(status, regions))
    return folder


def run(*arguments):
    return main(["eval", *map(str, arguments)])
