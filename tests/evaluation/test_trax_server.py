"""TraX clients with the server in a separate process."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam.geometry import map_box

trax = pytest.importorskip("trax")

from trax.client import Client  # noqa: E402

SIZE = (320, 240)
BOX = (140.0, 90.0, 36.0, 40.0)
KCF = ("-m", "ssiam", "trax", "--tracker", "kcf", "--stabilize", "off")

# A tracker that prints incomplete lines from Python, from C and from a child process.
CHATTY = """
import ctypes, os, subprocess
from ssiam.evaluation.vot.trax import reserve_stdout, serve
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

class Chatty:
    def init(self, view, xywh):
        self.xywh = xywh
        self.talk()
    def update(self, view):
        self.talk()
        return Track(self.xywh, score=0.25)
    def talk(self):
        print("chatter", end="", flush=True)
        print("buffered until the end", end="")
        ctypes.CDLL(None).puts(b"chatter of C")
        os.write(2, b"chatter")
        subprocess.run(["echo", "chatter"])

with reserve_stdout():
    serve(StabilizedTracker(Chatty(), StabilizerConfig("off")))
"""


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Image files of a shaking clip, and the true box in each."""
    folder = tmp_path_factory.mktemp("frames")
    frame_from_world = poses(generator(3).normal(0, (1.5, 1, 0.0), (8, 3)), SIZE)
    scene = world(size_wh=SIZE)
    paths = []
    for index, pose in enumerate(frame_from_world):
        paths.append(folder / f"{index}.png")
        cv2.imwrite(str(paths[-1]), camera_frame(scene, pose))
    start = np.linalg.inv(frame_from_world[0])
    return paths, [map_box(pose @ start, BOX) for pose in frame_from_world]


class Served:
    """A server process and its client."""

    def __init__(self, *arguments, stderr=subprocess.PIPE):
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
        )
        self.messages = []
        streams = self.process.stdin.fileno(), self.process.stdout.fileno()
        self.client = Client(stream=streams, log=self.messages.append)

    def start(self, path, region):
        return self.client.initialize(image(path), [(region, {})], {})[0]

    def track(self, path):
        return self.client.frame(image(path), {}, [])[0]

    def end(self):
        """Exit code, remaining standard output, and standard error."""
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out.decode(), (err or b"").decode()


def image(path):
    return {"color": trax.FileImage.create(str(path))}


def square(x, y, w, h):
    return trax.Polygon.create([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])


def test_rectangles_then_polygons_in_one_process(frames):
    paths, truth = frames
    served = Served(*KCF)
    assert set(served.client.region_formats) == {"rectangle", "polygon"}
    x, y, w, h = BOX
    for start in (trax.Rectangle.create(*BOX), square(x, y, w - 1, h - 1)):
        ((first, _),) = served.start(paths[0], start)
        assert first.type == start.type
        for path, (true_x, true_y, _, _) in zip(paths[1:], truth[1:], strict=True):
            ((region, properties),) = served.track(path)
            assert region.type == start.type
            found = region.bounds()[:2] if region.type == "rectangle" else region[0]
            assert np.hypot(*np.subtract(found, (true_x, true_y))) < 6
            assert 0.5 < float(properties["confidence"]) <= 1
    served.client.quit()
    assert served.end() == (0, "", "")


@pytest.mark.parametrize(
    "stderr", [subprocess.PIPE, subprocess.STDOUT], ids=["two pipes", "one pipe"]
)
def test_other_output_does_not_reach_the_protocol(frames, stderr):
    served = Served("-c", CHATTY, stderr=stderr)
    served.start(frames[0][0], trax.Rectangle.create(*BOX))
    for path in frames[0][1:]:
        ((_, properties),) = served.track(path)
        assert float(properties["confidence"]) == 0.25
    served.client.quit()
    code, out, err = served.end()
    assert (code, out) == (0, "")
    assert not any("chatter" in each or "buffered" in each for each in served.messages)
    assert (err.count("chatter of C") > 0) == (stderr == subprocess.PIPE)


@pytest.mark.parametrize("when", ["first", "later"])
def test_an_unreadable_frame_ends_with_one_line_and_a_quit_message(frames, tmp_path, when):
    served = Served(*KCF)
    broken = tmp_path / "missing.png"
    if when == "first":
        with pytest.raises(trax.TraxException, match=r"missing\.png: does not exist"):
            served.start(broken, trax.Rectangle.create(*BOX))
    else:
        broken.write_text("no image")
        served.start(frames[0][0], trax.Rectangle.create(*BOX))
        with pytest.raises(trax.TraxException, match=r"missing\.png: is not an image"):
            served.track(broken)
    code, out, err = served.end()
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"ssiam: {broken}")


def test_a_target_outside_of_the_frame_is_refused(frames):
    served = Served(*KCF)
    with pytest.raises(trax.TraxException, match="outside of the frame"):
        served.start(frames[0][0], trax.Rectangle.create(900, 9, 20, 20))
    code, _, err = served.end()
    assert (code, err.count("\n")) == (2, 1)


def test_no_frames():
    served = Served(*KCF)
    served.client.quit()
    assert served.end() == (0, "", "")


@pytest.mark.parametrize(
    ("words", "code", "reason"),
    [
        pytest.param("", 3, "the TraX client disconnected", id="disconnects"),
        pytest.param("frame", 3, "the TraX client disconnected", id="frame without an image"),
        pytest.param(
            'frame "file://PATH"', 3, "before it started a target", id="frame before a target"
        ),
        pytest.param(
            'initialize "nonsense"\n@@TRAX:frame "file://PATH"',
            3,
            "violated the protocol",
            id="not a region",
        ),
    ],
)
def test_a_client_that_violates_the_protocol(frames, words, code, reason):
    sent = f"@@TRAX:{words}\n".replace("PATH", str(frames[0][0])) if words else ""
    done = subprocess.run(
        [sys.executable, *KCF], input=sent, capture_output=True, text=True, timeout=30
    )
    assert done.returncode == code
    assert done.stderr.startswith("ssiam: ")
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
    assert all(line.startswith("@@TRAX:") for line in done.stdout.splitlines())


def test_standard_error_is_restored():
    """Also if it was the same file as standard output."""
    code = (
        "import os, sys; from ssiam.evaluation.vot.trax import reserve_stdout\n"
        "with reserve_stdout():\n"
        "    os.write(int(os.environ['TRAX_OUT']), b'message;')\n"
        "    print('out', flush=True); print('err', file=sys.stderr)\n"
        "print('last words', file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=30,
    )
    assert done.stdout == b"message;last words\n"
