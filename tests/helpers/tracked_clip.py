"""A shaky clip, running `ssiam` on it in a process, and reading its outputs."""

import csv
import subprocess
import sys
from fractions import Fraction

import av
import numpy as np

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam.geometry import map_box
from ssiam.video import VideoSink

SIZE = (320, 240)
BOX = (140.0, 90.0, 36.0, 40.0)
COUNT = 40


def write_clip(path, count=COUNT, fps=Fraction(30000, 1001)):
    """Write a shaky clip; returns the true position of BOX in each frame."""
    frame_from_world = poses(generator(2).normal(0, (3, 2, 0.004), (count, 3)), SIZE)
    image = world(size_wh=SIZE)
    with VideoSink(path, fps) as sink:
        for pose in frame_from_world:
            sink.write(camera_frame(image, pose))
    start = np.linalg.inv(frame_from_world[0])
    return [map_box(pose @ start, BOX) for pose in frame_from_world]


def box_of(box):
    return ",".join(str(v) for v in box)


def decoded(path):
    with av.open(str(path)) as container:
        return list(container.decode(video=0)), container.streams.video[0].average_rate


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def run(*arguments, **options):
    """Run `ssiam` in a separate process."""
    command = [sys.executable, "-m", "ssiam", *(str(a) for a in arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
