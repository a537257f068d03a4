"""Clones of one tracker in parallel threads give the same results as one after the other.

All threads wait for each other after each inference, before they read the outputs: trackers that
share buffers would read each other's outputs on every machine and in every run.
"""

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np
import pytest

import ssiam
from helpers.synthetic import golden_video
from ssiam.runtime import loading
from ssiam.video import open_source

THREADS = 4
WAIT = 300  # seconds until a missing thread fails the test
ALEX, R50, MASK = "siamrpn_alex_dwxcorr", "siamrpn_r50_l234_dwxcorr", "siammask_r50_l3"


@pytest.fixture(scope="module")
def frames(request):
    with open_source(request.config.rootpath / "examples" / "shaky-walker.mp4") as source:
        return [frame.image for frame, _ in zip(source, range(6), strict=False)]


BOXES = [  # the walker, and three parts of the scene
    (53.2, 114.1, 26.5, 66.4),
    (150.0, 60.0, 60.0, 40.0),
    (200.0, 120.0, 30.0, 50.0),
    (100.0, 30.0, 44.0, 44.0),
]


def tracked(tracker, box, frames, before=lambda: None):
    """Boxes, scores, corners and masks of a target: all results that depend on the networks."""
    tracker.init(frames[0], box)
    results = []
    for frame in frames[1:]:
        before()
        track = tracker.update(frame)
        mask = None if track.mask is None else np.packbits(track.mask).tobytes()
        corners = None if track.corners is None else track.corners.tolist()
        results.append((track.box, track.score, corners, mask))
    return results


def in_parallel(jobs, barrier):
    """The results of the jobs, each run in its own thread."""

    def run(job):
        try:
            return job()
        except BaseException:
            barrier.abort()  # so that no thread waits for this one
            raise

    with ThreadPoolExecutor(len(jobs)) as pool:
        return [done.result() for done in [pool.submit(run, job) for job in jobs]]


def patch_openvino(monkeypatch, wait):
    from ssiam.runtime.openvino import ov

    infer = ov.InferRequest.infer

    def infer_and_wait(request, share_outputs):
        assert share_outputs  # copies could be made before the other threads arrive
        results = infer(request, share_outputs=True)
        wait()
        return results

    monkeypatch.setattr(ov.InferRequest, "infer", infer_and_wait)


def patch_onnxruntime(monkeypatch, wait):
    ort = pytest.importorskip("onnxruntime")
    run = ort.InferenceSession.run

    def run_and_wait(session, *arguments):
        results = run(session, *arguments)
        wait()
        return results

    monkeypatch.setattr(ort.InferenceSession, "run", run_and_wait)


def patch_torch(monkeypatch, wait):
    torch = pytest.importorskip("torch")
    from ssiam.networks import export as graphs

    for kind in (graphs.TemplateGraph, graphs.SearchGraph, graphs.RefineGraph):

        def forward_and_wait(graph, *inputs, forward=kind.forward):
            results = forward(graph, *inputs)
            wait()
            return results

        monkeypatch.setattr(kind, "forward", forward_and_wait)
    assert torch.nn.Module.__call__  # which calls forward


PATCHES = {"openvino": patch_openvino, "onnxruntime": patch_onnxruntime, "torch": patch_torch}


def check(monkeypatch, runtime, first, frames):
    """Compare four trackers in four threads with one after the other, on different targets."""
    alone = [tracked(first, box, frames) for box in BOXES]
    assert len({str(results) for results in alone}) == THREADS  # a mix-up would be noticed
    barrier = threading.Barrier(THREADS, timeout=WAIT)
    PATCHES[runtime](monkeypatch, barrier.wait)
    trackers = [first, *(first.clone() for _ in BOXES[1:])]
    jobs = [
        lambda tracker=tracker, box=box: tracked(tracker, box, frames)
        for tracker, box in zip(trackers, BOXES, strict=True)
    ]
    together = None
    with suppress(threading.BrokenBarrierError):
        together = in_parallel(jobs, barrier)
    assert together == alone


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_lite(monkeypatch, frames, runtime):
    pytest.importorskip(runtime)
    check(monkeypatch, runtime, ssiam.load_tracker(stabilize="off", runtime=runtime), frames)


@pytest.mark.parametrize("version", ["v1", "v3"])
@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_nanotrack(monkeypatch, shared, frames, runtime, version):
    pytest.importorskip(runtime)
    weights = shared(f"data/weights/nanotrack{version}")
    first = ssiam.load_tracker(
        f"nanotrack_{version}", weights=weights, stabilize="off", runtime=runtime
    )
    check(monkeypatch, runtime, first, frames)


@pytest.mark.parametrize(
    ("golden", "name", "count"),
    [("siamfc", "siamfc", 4), (ALEX, ALEX, 4), (MASK, "siammask_e", 2), (R50, R50, 2)],
)
@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime", "torch"])
def test_the_papers_trackers(monkeypatch, runtime, golden, name, count):
    pytest.importorskip("torch")
    pytest.importorskip("onnx")
    from helpers.network_models import SLOW, checkpoint, exported, folder

    if not SLOW and (golden == R50 or (golden, runtime) == (MASK, "onnxruntime")):
        pytest.skip("takes half a minute: set SSIAM_SLOW")

    monkeypatch.setenv("XDG_CACHE_HOME", str(folder() / "cache"))
    weights = checkpoint(golden) if runtime == "torch" else exported(golden)
    first = ssiam.load_tracker(name, weights=weights, stabilize="off", runtime=runtime)
    check(monkeypatch, runtime, first, golden_video("A", count)[0])


def test_networks_with_shared_weights(monkeypatch):
    pytest.importorskip("torch")
    pytest.importorskip("onnx")
    from helpers.network_models import exported, folder

    monkeypatch.setenv("XDG_CACHE_HOME", str(folder() / "cache"))
    monkeypatch.setattr(loading, "_MIN_SHARED_BYTES", 1_000_000)
    first = ssiam.load_tracker(ALEX, weights=exported(ALEX), stabilize="off")
    check(monkeypatch, "openvino", first, golden_video("A", 4)[0])


@pytest.mark.parametrize("stabilize", ["predict", "paper"])
def test_stabilized_with_following_frames(frames, stabilize):
    """Camera motion, prediction and the thread for `following` are not shared."""

    def run(tracker, box):
        tracker.init(frames[0], box)
        return [
            (track.box, track.score, track.stab_from_raw.tobytes())
            for frame, after in zip(frames[1:], [*frames[2:], None], strict=True)
            for track in [tracker.update(frame, following=after)]
        ]

    first = ssiam.load_tracker(stabilize=stabilize)
    alone = [run(first, box) for box in BOXES]
    barrier = threading.Barrier(THREADS, timeout=WAIT)
    trackers = [first, *(first.clone() for _ in BOXES[1:])]
    jobs = [
        lambda tracker=tracker, box=box: run(tracker, box)
        for tracker, box in zip(trackers, BOXES, strict=True)
    ]
    assert in_parallel(jobs, barrier) == alone


@pytest.mark.parametrize("name", ["csrt", "kcf", "mil"])
def test_opencv(frames, name):
    """All threads start each frame at the same time."""
    first = ssiam.load_tracker(name, stabilize="off")
    alone = [tracked(first, box, frames) for box in BOXES]
    barrier = threading.Barrier(THREADS, timeout=WAIT)
    trackers = [first, *(first.clone() for _ in BOXES[1:])]
    jobs = [
        lambda tracker=tracker, box=box: tracked(tracker, box, frames, barrier.wait)
        for tracker, box in zip(trackers, BOXES, strict=True)
    ]
    assert in_parallel(jobs, barrier) == alone


@pytest.mark.parametrize("keypoints", ssiam.motion.KEYPOINTS)
def test_camera_motion(frames, keypoints):
    def run(part, before=lambda: None):
        camera = ssiam.CameraMotion(keypoints)
        motions = []
        for frame in part:
            before()
            motions.append(camera.update(frame).cur_from_prev.tolist())
        return motions

    parts = [frames, frames[::-1], frames[:1] + frames[2:] + frames[1:2], frames[3:] + frames[:3]]
    alone = [run(part) for part in parts]
    barrier = threading.Barrier(THREADS, timeout=WAIT)
    jobs = [lambda part=part: run(part, barrier.wait) for part in parts]
    assert in_parallel(jobs, barrier) == alone
