"""Run your own tracker on stabilized views: python own_tracker.py clip.mp4 120,80,40,60."""

import sys

import cv2
import numpy as np

import ssiam
from ssiam.video import open_source


class TemplateTracker:
    """Template matching; `ssiam.trackers.base.ViewTracker` describes the methods."""

    can_seek, reseek_below, center_inset = True, 0.5, 0.0

    def init(self, view: ssiam.FrameView, xywh: ssiam.geometry.XYWH) -> None:
        self.xywh, self.size_wh = xywh, (round(xywh[2]), round(xywh[3]))
        self.template = view.crop_rectangle(xywh, self.size_wh, np.zeros(3))

    def seek(self, view: ssiam.FrameView, xywh: ssiam.geometry.XYWH) -> ssiam.Track:
        (x, y, _, _), (w, h) = xywh, self.size_wh
        region = view.crop_rectangle((x - w, y - h, 3 * w, 3 * h), (3 * w, 3 * h), np.zeros(3))
        scores = cv2.matchTemplate(region, self.template, cv2.TM_CCOEFF_NORMED)
        _, best, _, (right, down) = cv2.minMaxLoc(scores)
        self.xywh = x - w + right, y - h + down, w, h
        return ssiam.Track(self.xywh, score=max(best, 0.0))

    def track(self, view: ssiam.FrameView) -> ssiam.Track:
        return self.seek(view, self.xywh)

    def clone(self) -> "TemplateTracker":
        return TemplateTracker()


tracker = ssiam.StabilizedTracker(TemplateTracker(), ssiam.StabilizerConfig("predict"))
frames = open_source(sys.argv[1])
tracker.init(next(frames).image, [float(number) for number in sys.argv[2].split(",")])
for frame in frames:
    print(frame.index, tracker.update(frame.image))
