"""Small benchmarks for the tests of tables and figures."""

import cv2
import numpy as np

from helpers.benchmark_runs import square, trajectory
from ssiam.datasets import open_dataset
from ssiam.evaluation.bench import run_all, tasks
from ssiam.evaluation.layouts import vot_path, write_vot


def bench(path, out, competitors, protocol="vot"):
    done = list(run_all(tasks(competitors, open_dataset(path), path, out, protocol)))
    assert not any(each.failed for each in done)
    return done


def write_vot_year(folder, counts, size_wh=(200, 160)):
    """A year of VOT: sequences of polygons, one image each for the size of the frames."""
    for name, count in counts.items():
        (folder / name).mkdir(parents=True)
        for number in range(1, count + 1):
            (folder / name / f"{number:08}.jpg").touch()
        picture = np.full((size_wh[1], size_wh[0], 3), 90, np.uint8)
        cv2.imwrite(str(folder / name / "00000001.jpg"), picture)
        rows = (",".join(f"{value:.2f}" for value in row) for row in square(count, 20.0))
        (folder / name / "groundtruth.txt").write_text("\n".join(rows) + "\n")
    return folder


def write_run(out, label, name, codes, shift=0.0):
    """A supervised run: see `runs.trajectory`."""
    run = trajectory(codes, square(len(codes), 20.0), shift)
    write_vot(vot_path(out / label, name), run)
