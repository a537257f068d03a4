"""Small benchmarks and result folders for the tests of tables and figures."""

import cv2
import numpy as np

from helpers.benchmark_runs import square, trajectory
from ssiam.datasets import open_dataset
from ssiam.evaluation.runs.bench import run_all, tasks
from ssiam.evaluation.runs.result_files import vot_path, write_vot


def bench(path, out, entries, protocol="vot"):
    results = list(run_all(tasks(entries, open_dataset(path), path, out, protocol)))
    assert not any(each.failed for each in results)
    return results


def write_vot_year(folder, counts, size_wh=(200, 160)):
    """A VOT dataset with polygons; only the first image of each sequence is readable."""
    for name, count in counts.items():
        (folder / name).mkdir(parents=True)
        for number in range(1, count + 1):
            (folder / name / f"{number:08}.jpg").touch()
        image = np.full((size_wh[1], size_wh[0], 3), 90, np.uint8)
        cv2.imwrite(str(folder / name / "00000001.jpg"), image)
        rows = (",".join(f"{value:.2f}" for value in row) for row in square(count, 20.0))
        (folder / name / "groundtruth.txt").write_text("\n".join(rows) + "\n")
    return folder


def write_run(out, label, name, codes, shift=0.0):
    """Write a supervised run; see `benchmark_runs.trajectory`."""
    run = trajectory(codes, square(len(codes), 20.0), shift)
    write_vot(vot_path(out / label, name), run)
