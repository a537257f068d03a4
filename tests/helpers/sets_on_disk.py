"""Small training sets, written to disk in their published layouts."""

from __future__ import annotations

import json
import struct
import zlib

import cv2
import numpy as np

from ssiam.training import SourceSettings, open_training_source

# The object of every image unless given otherwise: x, y, w, h.
BOX = (60, 50, 40, 30)
OTHER = (200, 140, 30, 40)
SIZE_WH = (320, 240)


def scene(*boxes, seed=0, size_wh=SIZE_WH):
    """Dark noise with bright rectangles."""
    width, height = size_wh
    image = np.random.default_rng(seed).integers(0, 60, (height, width, 3), dtype=np.uint8)
    for number, (x, y, w, h) in enumerate(boxes):
        image[y : y + h, x : x + w] = (200, 255 - 60 * number, 220)
    return image


def mask_of(*boxes, size_wh=SIZE_WH, labels=None):
    """A label image (H, W) uint8 of boxes, with 255 in each unless `labels` are given."""
    mask = np.zeros(size_wh[::-1], np.uint8)
    for number, (x, y, w, h) in enumerate(boxes):
        mask[y : y + h, x : x + w] = (labels or [255] * len(boxes))[number]
    return mask


def write_image(path, image):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)
    return path


def write_palette_png(path, indices, palette):
    """A PNG of palette indices (H, W) uint8, which OpenCV cannot write."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    height, width = indices.shape
    rows = b"".join(b"\0" + row.tobytes() for row in indices)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0))
        + chunk(b"PLTE", bytes(value for color in palette for value in color))
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


def write_davis(root, name="bear", frames=3, hidden=()):
    for t in range(frames):
        x, y, w, h = BOX
        box = (x + 4 * t, y, w, h)
        boxes = () if t in hidden else (box,)
        write_image(root / f"JPEGImages/480p/{name}/{t:05}.jpg", scene(*boxes, seed=t))
        write_image(root / f"Annotations/480p/{name}/{t:05}.png", mask_of(*boxes))
    return root


def write_voc(root, objects_by_stem, folders=("JPEGImages", "Annotations")):
    """`objects_by_stem`: a list of (name, corners) for each file."""
    for stem, objects in objects_by_stem.items():
        boxes = [
            (int(float(a)) - 1, int(float(b)) - 1, int(float(c) - float(a)), 20)
            for _, (a, b, c, _) in objects
        ]
        write_image(root / folders[0] / f"{stem}.jpg", scene(*boxes))
        entries = "".join(
            f"<object><name>{name}</name><bndbox>"
            + "".join(
                f"<{tag}>{value}</{tag}>"
                for tag, value in zip(("xmin", "ymin", "xmax", "ymax"), corners, strict=True)
            )
            + "</bndbox></object>"
            for name, corners in objects
        )
        (root / folders[1]).mkdir(parents=True, exist_ok=True)
        (root / folders[1] / f"{stem}.xml").write_text(f"<annotation>{entries}</annotation>")
    return root


def write_coco(root, annotations, count=1):
    images = []
    for number in range(1, count + 1):
        write_image(root / f"train/{number:06}.png", scene(BOX, OTHER, seed=number))
        images.append({"id": number, "file_name": f"{number:06}.png"})
    path = root / "annotations/instances_train.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"images": images, "annotations": annotations}))
    return path


def write_cutouts(root, count=3):
    """Ellipses with alpha in stamps/, and backgrounds in grounds/."""
    for number in range(count):
        cutout = np.zeros((60, 80, 4), np.uint8)
        cv2.ellipse(cutout, (40, 30), (30, 20), 0, 0, 360, (40 * number, 80, 250, 255), -1)
        write_image(root / f"stamps/{number}.png", cutout)
        write_image(root / f"grounds/{number}.jpg", scene(OTHER, seed=number))
    return root


def open_set(layout, path, **options):
    return open_training_source(SourceSettings(layout, str(path), **options))
