"""Small drawn sequences as a classic VOT folder, as an OTB folder and as pysot's JSON."""

import json

import cv2
import numpy as np

from helpers.synthetic import camera_frame, generator, poses, world

SIZE = (160, 120)  # width, height, pixels
TARGET = (28, 22)  # width, height, pixels
SHAKE = (3.0, 3.0, 0.01)  # standard deviation of dx, dy in pixels and of the angle in radians


def drawn_sequence(seed, count, shake=SHAKE):
    """Images (120, 160, 3) uint8 of a patch on a shaken background, and its polygons (count, 8)."""
    r = generator(seed)
    patch = r.integers(0, 256, (11, 14, 3), np.uint8)
    patch = cv2.resize(patch, TARGET, interpolation=cv2.INTER_NEAREST)
    scene, left, top = world(seed, SIZE), 40, 50
    images, polygons = [], []
    for index, pose in enumerate(poses(r.normal(0, shake, (count, 3)), SIZE)):
        x, y = left + 2 * index, top + index % 3
        scene_now = scene.copy()
        scene_now[y : y + TARGET[1], x : x + TARGET[0]] = patch
        images.append(camera_frame(scene_now, pose))
        corners = np.array([(x, y), (x + 28, y), (x + 28, y + 22), (x, y + 22)], np.float64)
        polygons.append((corners @ pose[:2, :2].T + pose[:2, 2]).ravel())
    return images, np.array(polygons)


def write_vot_folder(folder, counts, shake=SHAKE):
    """The classic layout: images and groundtruth.txt in each folder, tag files, and list.txt."""
    for seed, (name, count) in enumerate(counts.items()):
        images, polygons = drawn_sequence(seed, count, shake)
        (folder / name).mkdir(parents=True)
        _write_images(folder / name, images, 8)
        _write_rows(folder / name / "groundtruth.txt", polygons)
        for tag, first in (("camera_motion", 0), ("occlusion", count // 2)):
            flags = "".join(f"{int(index >= first)}\n" for index in range(count))
            (folder / name / f"{tag}.tag").write_text(flags)
    (folder / "list.txt").write_text("".join(f"{name}\n" for name in counts))
    return folder


def write_otb_folder(folder, counts):
    """OTB's layout: img/ and groundtruth_rect.txt, whose upright boxes are 1-based."""
    for seed, (name, count) in enumerate(counts.items()):
        images, polygons = drawn_sequence(seed, count)
        (folder / name / "img").mkdir(parents=True)
        _write_images(folder / name / "img", images, 4)
        low = polygons.reshape(count, 4, 2).min(axis=1)
        high = polygons.reshape(count, 4, 2).max(axis=1)
        rows = np.hstack([low + 1, high - low])
        _write_rows(folder / name / "groundtruth_rect.txt", rows)
    return folder


def write_pysot_json(path, counts):
    """pysot's JSON, with the images in a folder of its name."""
    records = {}
    for seed, (name, count) in enumerate(counts.items()):
        images, polygons = drawn_sequence(seed, count)
        color = path.parent / path.stem / name / "color"
        color.mkdir(parents=True)
        _write_images(color, images, 8)
        records[name] = {
            "video_dir": name,
            "init_rect": polygons[0].tolist(),
            "img_names": [f"{name}/color/{number:08}.jpg" for number in range(1, count + 1)],
            "gt_rect": polygons.tolist(),
            "camera_motion": [1] * count,
            "occlusion": [],
        }
    path.write_text(json.dumps(records))
    return path


def _write_images(folder, images, digits):
    for number, image in enumerate(images, 1):
        cv2.imwrite(str(folder / f"{number:0{digits}}.jpg"), image)


def _write_rows(path, rows):
    path.write_text("".join(",".join(f"{value:.3f}" for value in row) + "\n" for row in rows))
