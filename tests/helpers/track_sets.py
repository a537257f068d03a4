"""Folders of tracks cropped from a video of bright rectangles."""

import json

from helpers.sets_on_disk import scene, write_image

# Size of the bright rectangles in frames of 320 x 240.
SIZE = (20, 30)


def position(number, frame):
    """Left and top edge of an object in a frame of its video."""
    return 40 + 60 * number + frame, 80 + 10 * number


def write_track(root, name, number, regions, *, video="park", category="person", **meta):
    """A folder of the object `number`; `regions` (x0, y0, x1, y1, scale) by frame."""
    folder = root / name
    lines = []
    for index, (frame, (left, top, right, bottom, scale)) in enumerate(regions.items(), 1):
        drawn = [(*position(each, frame), *SIZE) for each in range(4)]
        image = scene(*drawn)[top:bottom, left:right]
        image = image.repeat(scale, axis=0).repeat(scale, axis=1)
        write_image(folder / f"{index:08}.png", image)
        x, y = position(number, frame)
        box = (x - left, y - top, *SIZE)
        lines.append(",".join(f"{value * scale:.2f}" for value in box) + "\n")
    (folder / "groundtruth.txt").write_text("".join(lines))
    (folder / "absence.label").write_text("0\n" * len(regions))
    content = {
        "video": video,
        "track_id": number,
        "category": category,
        "frames": list(regions),
        "crop_windows_x0y0x1y1_scale": [list(region) for region in regions.values()],
    }
    (folder / "meta.json").write_text(json.dumps(content | meta))
    return folder


WHOLE = (0, 0, 320, 240, 1)
RIGHT = (90, 60, 250, 180, 2)


def write_walkers(folder):
    sets = folder / "walkers"
    write_track(sets, "park_id000_s0", 0, {0: WHOLE, 10: WHOLE, 20: WHOLE})
    write_track(sets, "park_id001_s0", 1, {0: RIGHT, 10: (60, 60, 200, 150, 1)})
    write_track(sets, "park_id001_s1", 1, {20: WHOLE, 40: WHOLE})
    write_track(sets, "park_id002_s0", 2, {0: WHOLE, 20: RIGHT})
    write_track(sets, "street_id000_s0", 0, {0: WHOLE}, video="street")
    write_track(sets, "park_id003_s0", 3, {0: WHOLE}, category="bag")
    return folder
