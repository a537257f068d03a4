"""Small datasets in their published layouts, written to disk."""

from __future__ import annotations

import cv2
import numpy as np

_STEP = 10  # gray levels between the images of consecutive numbers


def gray_image(number):
    return np.full((8, 12, 3), _STEP * number % 256, np.uint8)


def number_in(image):
    """The number of a `gray_image`."""
    return round(float(image.mean()) / _STEP)


def only(dataset):
    """The sequence of a dataset with a single one."""
    (name,) = dataset.sequences
    return dataset.sequences[name]


def frame_numbers(sequence):
    return [int(path.stem) for path in sequence.frames]


def write_images(folder, numbers, digits, suffix=".jpg"):
    """Images with these numbers as names; if there are more than 25, they are empty files."""
    folder.mkdir(parents=True, exist_ok=True)
    numbers = list(numbers)
    for number in numbers:
        path = folder / f"{number:0{digits}}{suffix}"
        if len(numbers) > 25:
            path.touch()
        else:
            cv2.imwrite(str(path), gray_image(number))


def boxes(count, first=1):
    """Rows x, y, w, h, where x is the row number and y ten times the row number."""
    return np.array([(i, 10 * i, 5, 6) for i in range(first, first + count)], dtype=float)


def text(rows, separator=","):
    return "".join(separator.join(f"{value:g}" for value in row) + "\n" for row in rows)


def write_otb(root, name, numbers, rows, *, digits=4, separator=",", file="groundtruth_rect.txt"):
    write_images(root / name / "img", numbers, digits)
    (root / name / file).write_text(text(rows, separator))
    return root / name


def write_vot(root, name, count=3, *, toolkit=False, polygon=False, tags=None):
    folder = root / name
    write_images(folder / "color" if toolkit else folder, range(1, count + 1), 8)
    rows = boxes(count)
    if polygon:
        x, y, w, h = rows.T
        rows = np.stack([x, y, x + w, y, x + w, y + h, x, y + h], axis=1)
    (folder / "groundtruth.txt").write_text(text(rows))
    if toolkit:
        (folder / "sequence").write_text(
            f"name={name}\nfps=30\nformat=default\nchannel.default=color\n"
            f"channels.color=color/%08d.jpg\nwidth=12\nheight=8\nlength={count}\n"
        )
    for tag, flags in (tags or {}).items():
        (folder / tag).write_text("".join(f"{flag}\n" for flag in flags))
    return folder


def write_uav123(root, name, video, numbers, rows, version="UAV123"):
    write_images(root / "data_seq" / version / video, numbers, 6)
    (root / "anno" / version).mkdir(parents=True, exist_ok=True)
    (root / "anno" / version / f"{name}.txt").write_text(text(rows))


def write_got10k(root, split, number, count=3, *, rows=None):
    name = f"GOT-10k_{split.title()}_{number:06}"
    folder = root / split / name
    write_images(folder, range(1, count + 1), 8)
    (folder / "groundtruth.txt").write_text(text(boxes(count) if rows is None else rows))
    with (root / split / "list.txt").open("a") as file:
        file.write(f"{name}\n")
    return folder


def write_lasot(root, name, count=3, rows=None):
    folder = root / name.rpartition("-")[0] / name
    write_images(folder / "img", range(1, count + 1), 8)
    (folder / "groundtruth.txt").write_text(text(boxes(count) if rows is None else rows))
    (folder / "full_occlusion.txt").write_text(",".join(["0"] * (count - 1) + ["1"]) + "\n")
    (folder / "out_of_view.txt").write_text(",".join(["0"] * count) + "\n")
    (folder / "nlp.txt").write_text("a white airplane\n")
    return folder


def write_mot(root, name, lines, count=4, *, info=True, images=None):
    """A clip of MOTChallenge; `lines` are rows of numbers, or the text of gt.txt."""
    folder = root / name
    write_images(folder / "img1", images or range(1, count + 1), 6)
    (folder / "gt").mkdir()
    content = lines if isinstance(lines, str) else text(lines)
    (folder / "gt" / "gt.txt").write_text(content)
    if info:
        (folder / "seqinfo.ini").write_text(
            f"[Sequence]\nname={name}\nimDir=img1\nframeRate=30\nseqLength={count}\n"
            "imWidth=12\nimHeight=8\nimExt=.jpg\n"
        )
    return folder
