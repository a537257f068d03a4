"""The picking page in a real browser, with the command that opens it."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from helpers.browsing import PHONE, SECONDS
from helpers.walking_clip import RATE, SIZE, write_shaking_clip
from ssiam.exchange import read_annotations
from ssiam.geometry import iou

SSIAM = "import sys; from ssiam.cli import main; sys.exit(main())"


class Command:
    """`ssiam track` on a terminal, without a browser of its own."""

    def __init__(self, clip, folder, *arguments):
        hidden = ("DISPLAY", "WAYLAND_DISPLAY", "SSH_CONNECTION", "SSH_TTY")
        environment = {name: value for name, value in os.environ.items() if name not in hidden}
        environment["PYTHONPATH"] = os.pathsep.join(sys.path)
        self._terminal, end = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", SSIAM, "track", str(clip), *arguments],
            cwd=folder,
            env=environment,
            stdin=end,
            stderr=end,
            stdout=subprocess.PIPE,
            text=True,
        )
        os.close(end)
        self.shown = ""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        while True:
            try:
                self.shown += os.read(self._terminal, 4096).decode(errors="replace")
            except OSError:  # the other end is closed
                return

    def address(self):
        """The printed address."""
        deadline = time.monotonic() + SECONDS
        while time.monotonic() < deadline:
            found = re.search(r"http://\S+(?=\s)", self.shown)
            if found:
                return found[0]
            assert self.process.poll() is None, self.shown
            time.sleep(0.05)
        raise AssertionError(self.shown)

    def end(self):
        """Exit code and standard output."""
        output, _ = self.process.communicate(timeout=3 * SECONDS)
        self._reader.join(SECONDS)
        os.close(self._terminal)
        return self.process.returncode, output


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A short clip and its ground truth."""
    path = tmp_path_factory.mktemp("picked") / "shaking.mp4"
    return path, write_shaking_clip(path, 30)


@pytest.fixture
def track(clip, tmp_path):
    """A function that starts the command; it is killed if the test fails."""
    started = []

    def start(*arguments):
        command = Command(clip[0], tmp_path, *arguments)
        started.append(command.process)
        return command

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait()


class Picker:
    """A person on the picking page."""

    def __init__(self, visitor, *, touch=False):
        self.visitor, self.page, self._touch = visitor, visitor.page, touch
        self.until(lambda state: state["step"])

    def state(self):
        read = "() => ({step: window.ssiamPick?.step, selected: window.ssiamPick?.selected, "
        return self.page.evaluate(read + "...window.ssiamPick?.state})")

    def until(self, condition):
        """The state as soon as it meets the condition."""
        deadline = time.monotonic() + 2 * SECONDS
        while time.monotonic() < deadline:
            state = self.state()
            if condition(state):
                return state
            time.sleep(0.03)
        raise AssertionError(f"the condition was not met; last state: {state}")

    def choose(self, box):
        """Click or tap the middle of a box."""
        x, y, w, h = box
        point = self.visitor.to_client((x + w / 2, y + h / 2))
        if self._touch:
            self.page.touchscreen.tap(*point)
        else:
            self.page.mouse.click(*point)

    def press(self, name):
        button = self.page.get_by_role("button", name=name)
        if self._touch:
            button.tap()
        else:
            button.click()

    def seek(self, index):
        """Move the seek bar to a frame, and wait until that is shown."""
        bar = self.page.get_by_role("slider", name="Frame")
        bar.fill(str(index))
        self.until(lambda state: state["step"]["index"] == index)


@pytest.mark.parametrize("touch", [False, True], ids=["desk", "phone"])
def test_from_the_command_to_the_written_video_with_clicks_alone(
    track, visit, truth, tmp_path, touch
):
    command = track()
    phone = {"viewport": PHONE, "has_touch": True, "is_mobile": True, "device_scale_factor": 2}
    person = Picker(visit(command.address(), **(phone if touch else {})), touch=touch)
    person.choose(truth["stander"][0])
    person.until(lambda state: len(state["targets"]) == 1)
    person.press("Preview")
    person.until(lambda state: state["phase"] == "preview")
    person.until(lambda state: state["phase"] == "picking")
    assert person.state()["step"]["targets"][0]["score"] > 0
    assert person.page.evaluate("document.documentElement.scrollWidth") <= (
        PHONE["width"] if touch else 1280
    )
    person.press("Track the whole clip")
    written = person.until(lambda state: state["phase"] == "written")
    assert written["progress"]["done"] == written["length"]
    assert [file["name"] for file in written["files"]] == [
        "shaking-tracked.mp4",
        "shaking-tracked.csv",
    ]
    person.until(lambda state: person.page.evaluate("document.querySelector('video').readyState"))
    assert person.page.evaluate("document.querySelector('video').videoWidth") == SIZE[0]
    with person.page.expect_download() as download:
        person.page.get_by_role("link", name="shaking-tracked.csv").click()
    csv = tmp_path / "shaking-tracked.csv"
    assert Path(download.value.path()).read_bytes() == csv.read_bytes()
    person.press("Done")
    code, output = command.end()
    assert (code, "video: shaking-tracked.mp4" in output) == (0, True)
    rows = read_annotations(csv, SIZE, RATE)
    assert len(rows.names) == 1
    assert (tmp_path / "shaking-tracked.mp4").stat().st_size > 10_000


def test_boxes_in_several_frames_are_drawn_corrected_and_removed(track, visit, truth):
    command = track()
    person = Picker(visit(command.address()))
    visitor, page = person.visitor, person.page
    visitor.draw(truth["stander"][0])
    # A new target can be moved as soon as it is selected: the answer comes after the list.
    first = person.until(lambda state: state["selected"] == 1)["targets"][0]
    assert first["box"] == pytest.approx(truth["stander"][0], abs=1.5)
    x, y, w, h = first["box"]
    # The selected box is moved, and resized by a corner.
    visitor.press((x + w / 2, y + h / 2))
    visitor.release((x + w / 2 + 6, y + h / 2 + 4))
    moved = person.until(lambda state: state["targets"][0]["box"] != first["box"])["targets"][0]
    assert moved["box"] == pytest.approx((x + 6, y + 4, w, h), abs=1.5)
    left, top, w, h = moved["box"]
    visitor.press((left + w, top + h))
    visitor.release((left + w + 9, top + h + 5))
    resized = person.until(lambda state: state["targets"][0]["box"] != moved["box"])["targets"][0]
    assert resized["box"] == pytest.approx((left, top, w + 9, h + 5), abs=1.5)
    for _ in range(2):
        page.keyboard.press("Control+z")
    person.until(lambda state: state["targets"][0]["box"] == first["box"])
    # A second one begins later.
    person.seek(12)
    page.keyboard.press("ArrowRight")
    page.get_by_role("button", name="One frame forward").click()
    index = person.until(lambda state: state["step"]["index"] == 14)["step"]["index"]
    visitor.draw(truth["stander"][index])
    targets = person.until(lambda state: len(state["targets"]) == 2)["targets"]
    assert [target["frame"] for target in targets] == [0, index]
    page.get_by_text(f"from frame {index}").wait_for()
    # A click on the list shows the frame in which the target begins.
    page.get_by_role("button", name="Select target 1").click()
    person.until(lambda state: state["step"]["index"] == 0 and state["selected"] == 1)
    page.keyboard.press("Delete")
    person.until(lambda state: [target["id"] for target in state["targets"]] == [2])
    assert page.get_by_role("button", name="Select target 1").count() == 1
    visitor.leave()
    command.process.kill()


def test_the_tracked_box_is_that_of_the_page(track, visit, truth, tmp_path):
    command = track("--tracker", "csrt", "--results", "boxes.csv")
    person = Picker(visit(command.address()))
    person.seek(10)
    person.visitor.draw(truth["stander"][10])
    drawn = person.until(lambda state: state["targets"])["targets"][0]["box"]
    person.press("Track the whole clip")
    person.until(lambda state: state["phase"] == "written")
    assert person.page.locator("video").is_hidden()
    person.visitor.leave()
    code, _ = command.end()
    assert code == 0, "closing the page did not end the command"
    rows = read_annotations(tmp_path / "boxes.csv", SIZE, RATE).rows
    first = min((row for row in rows if not row.lost), key=lambda row: row.frame)
    assert first.frame == 10
    assert iou(first.xywh, tuple(drawn)) > 0.95


def test_ctrl_c_ends_the_command_while_a_person_chooses(track, visit, tmp_path):
    command = track()
    person = Picker(visit(command.address(), may_log_errors=True))
    command.process.send_signal(2)
    code, _ = command.end()
    assert code == 130
    person.page.get_by_role("alert").wait_for()
    assert list(tmp_path.iterdir()) == []
