"""Run your own tracker on stabilized views: python own_tracker.py clip.mp4 120,80,40,60."""

import sys

import cv2

import ssiam
from ssiam.video import open_source


class TemplateTracker:
    """Template matching; docs/how-to/extend.md describes what a tracker has."""

    reseek_below = 0.5

    def init(self, view: ssiam.FrameView, xywh: ssiam.geometry.XYWH) -> None:
        self.xywh, self.size_wh = xywh, (round(xywh[2]), round(xywh[3]))
        self.template = view.crop(xywh, self.size_wh).image

    def seek(self, view: ssiam.FrameView, xywh: ssiam.geometry.XYWH) -> ssiam.Track:
        (x, y, _, _), (w, h) = xywh, self.size_wh
        region = view.crop((x - w, y - h, 3 * w, 3 * h), (3 * w, 3 * h))
        scores = cv2.matchTemplate(region.image, self.template, cv2.TM_CCOEFF_NORMED)
        _, best, _, (right, down) = cv2.minMaxLoc(scores)
        self.xywh = region.box_in_view((right, down, w, h))
        return ssiam.Track(self.xywh, score=min(max(best, 0.0), 1.0))

    def update(self, view: ssiam.FrameView) -> ssiam.Track:
        return self.seek(view, self.xywh)


tracker = ssiam.StabilizedTracker(TemplateTracker(), ssiam.StabilizerConfig("predict"))
frames = open_source(sys.argv[1])
tracker.init(next(frames).image, [float(number) for number in sys.argv[2].split(",")])
for frame in frames:
    print(frame.index, tracker.update(frame.image))
