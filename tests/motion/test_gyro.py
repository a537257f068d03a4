"""A gyro beside the images: its logs, its clock and axes, and the rows of a rolling shutter."""

from itertools import pairwise

import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, world
from ssiam import ArgumentError, CameraMotion, Motion, SsiamError
from ssiam.geometry import map_point, map_points, rigid
from ssiam.motion import GyroCameraMotion, GyroTrack, read_gyro, synchronize

SIZE = (640, 360)
FOCAL = 500.0  # px
FPS = 30.0
RATE = 400.0  # Hz, of the gyro


def shake(seconds=6.0, seed=5):
    """A track of a hand-held camera: smooth random rates about three axes, rad/s."""
    times = np.arange(0, seconds, 1 / RATE)
    r = generator(seed)
    waves = r.uniform(2, 20, (12, 3)), r.uniform(0, 6.28, (12, 3)), r.normal(0, 0.12, (12, 3))
    rates = sum(a * np.sin(f * times[:, None] + p) for f, p, a in zip(*waves, strict=True))
    return GyroTrack(times, rates)


def seen_by(track, frames, noise=0.0):
    """Times and motions of a video of the camera."""
    times = 1.0 + np.arange(frames) / FPS
    r = generator(2)
    motions = [Motion.none(SIZE, reliable=True)]
    for start, end in pairwise(times):
        exact = track.motion(start, end, FOCAL, SIZE).cur_from_prev
        motions.append(Motion(rigid(*r.normal(0, noise, 2), 0) @ exact, 0.9, True, SIZE))
    return times, motions


@pytest.mark.parametrize("orientation", ["XYZ", "YxZ", "zyX", "xZy"])
def test_clock_axes_and_focal_length_are_found(orientation):
    track, offset = shake(), 0.735
    times, motions = seen_by(track, 90, noise=0.3)
    motions[40] = Motion.none(SIZE)
    sensor = track.shifted(-offset)
    rates = np.zeros_like(sensor.rates)
    for axis, letter in enumerate(orientation):  # the log's axes, of which these are the camera's
        sign = 1 if letter.isupper() else -1
        rates[:, "XYZ".index(letter.upper())] = sign * sensor.rates[:, axis]
    mounted = GyroTrack(sensor.times_s, rates)
    found = synchronize(mounted, times, motions, max_offset_s=2.0)
    assert found.orientation == orientation
    assert found.offset_s == pytest.approx(offset, abs=0.002)
    assert found.focal_length == pytest.approx(FOCAL, rel=0.02)
    assert found.correlation > 0.95
    expected = track.motion(times[9], times[10], FOCAL, SIZE).cur_from_prev
    again = found.track.motion(times[9], times[10], found.focal_length, SIZE).cur_from_prev
    corners = [[0, 0], [640, 0], [640, 360], [0, 360]]
    assert np.abs(map_points(again, corners) - map_points(expected, corners)).max() < 0.6


def test_another_camera_s_gyro_correlates_little():
    times, motions = seen_by(shake(), 90)
    assert synchronize(shake(seed=8), times, motions, max_offset_s=1.0).correlation < 0.7


def test_what_cannot_be_synchronized():
    track = shake()
    times, motions = seen_by(track, 30)
    still = [Motion.none(SIZE, reliable=True)] * 30
    with pytest.raises(ArgumentError, match="does not turn"):
        synchronize(track, times, still)
    with pytest.raises(ArgumentError, match="0 motions are reliable"):
        synchronize(track, times, [Motion.none(SIZE)] * 30)
    with pytest.raises(ArgumentError, match="too little time in common"):
        synchronize(track.shifted(100), times, motions, max_offset_s=1)
    with pytest.raises(ArgumentError, match="differ in length"):
        synchronize(track, times[:-1], motions)
    with pytest.raises(ArgumentError, match="orientation is 'XXZ'"):
        synchronize(track, times, motions, orientation="XXZ")


def test_the_gyro_replaces_unreliable_images():
    """Two black frames: then the motion is again that of the images."""
    times, rate = np.arange(0, 2, 1 / RATE), 0.15
    track = GyroTrack(times, np.tile([0.0, rate, 0.0], (len(times), 1)))
    scene = world(31, SIZE)
    step = FOCAL * np.tan(rate / FPS)
    frames = [camera_frame(scene, rigid(-step * n, 0, 0)) for n in range(6)]
    frames[2] = frames[3] = np.zeros_like(frames[0])
    fused = GyroCameraMotion(CameraMotion(), track, FOCAL)
    found = [fused.update(frame, number / FPS) for number, frame in enumerate(frames)]
    assert all(motion.reliable for motion in found)
    for motion in found[1:]:
        assert map_point(motion.cur_from_prev, 320, 180)[0] - 320 == pytest.approx(-step, abs=0.1)


def test_without_rates_the_image_decides():
    black = np.zeros((360, 640, 3), np.uint8)
    fused = GyroCameraMotion(CameraMotion(), shake(1.0), FOCAL)
    fused.update(world(31, SIZE), 5.0)
    assert not fused.update(black, 5.1).reliable


@pytest.mark.parametrize("readout", [0.8, -0.5])
def test_rows_of_a_rolling_shutter(readout):
    """A camera at constant speed: points are seen by the rows at their own times."""
    motion = Motion.from_transform(rigid(9, -5, 0.03, (320, 180)) @ np.diag([1.02, 1.02, 1]), SIZE)
    rows = motion.rows(readout)
    assert rows.shape == (360, 3, 3)
    first, last = rows[0], rows[-1]
    assert np.allclose(
        first @ np.linalg.inv(last), _power(motion.cur_from_prev, readout), atol=1e-6
    )
    middle = (rows[179] + rows[180]) / 2
    assert np.allclose(middle, np.eye(3), atol=1e-4)


def _power(matrix, exponent):
    values, vectors = np.linalg.eig(matrix)
    power = vectors @ np.diag(values**exponent) @ np.linalg.inv(vectors)
    return power.real / power.real[2, 2]


def test_rows_of_a_pure_shift():
    rows = Motion.from_transform(rigid(10, 0, 0), SIZE).rows(1.0)
    assert rows[:, 0, 2] == pytest.approx(-10 * (np.arange(360) - 179.5) / 359, abs=1e-6)


def test_rows_by_the_gyro_and_by_the_motion_agree_at_constant_speed():
    times = np.arange(0, 1, 1 / RATE)
    track = GyroTrack(times, np.tile([0.3, -0.2, 0.4], (len(times), 1)))
    motion = track.motion(0.5, 0.5 + 1 / FPS, FOCAL, SIZE)
    by_gyro, by_motion = track.rows(0.5, 0.02, FOCAL, SIZE), motion.rows(0.02 * FPS)
    for row in (0, 100, 359):
        points = [[0, row], [639, row]]
        difference = map_points(by_gyro[row], points) - map_points(by_motion[row], points)
        assert np.abs(difference).max() < 0.05


@pytest.mark.parametrize("readout", [1.5, float("nan"), "fast"])
def test_a_readout_that_cannot_be(readout):
    with pytest.raises(ArgumentError, match="readout is"):
        Motion.none(SIZE).rows(readout)


GYROFLOW = """GYROFLOW IMU LOG
version,1.3
id,logger
orientation,YxZ
tscale,0.001
gscale,0.01
ascale,0.0005
t,gx,gy,gz,ax,ay,az
0,100,200,300,1,2,3
5,110,210,310,1,2,3
5,0,0,0,1,2,3

10,120,220,320,1,2,3
"""
BLACKBOX = """"Product","Blackbox flight data recorder"
"gyro_scale","0x3f800000"
"loopIteration","time","axisP[0]","gyroADC[0]","gyroADC[1]","gyroADC[2]"
0,1000000,0,180,90,-90
4,1000500,0,180,90,-90
"""


def written(folder, text):
    path = folder / "log.csv"
    path.write_text(text)
    return path


def test_a_log_of_gyroflow(tmp_path):
    track = read_gyro(written(tmp_path, GYROFLOW))
    assert track.times_s == pytest.approx([0, 0.005, 0.01])
    assert track.rates[0] == pytest.approx([2, -1, 3])


@pytest.mark.parametrize(
    "text",
    [
        BLACKBOX,
        "loopIteration, time (us), axisP[0], gyroADC[0] (deg/s), gyroADC[1] (deg/s), "
        "gyroADC[2] (deg/s)\n" + BLACKBOX.split("\n", 3)[3],
    ],
)
def test_a_log_of_betaflight(tmp_path, text):
    track = read_gyro(written(tmp_path, text))
    assert track.times_s == pytest.approx([1.0, 1.0005])
    assert track.rates[1] == pytest.approx([np.pi / 2, -np.pi / 2, np.pi])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is neither"),
        ("a,b\n1,2\n", "is neither"),
        ("GYROFLOW IMU LOG\ngscale,1\n", "no line t,gx,gy,gz"),
        (GYROFLOW.replace("gscale,0.01", "gscale,-1"), "not above 0"),
        (GYROFLOW.replace("gscale,0.01\n", ""), "gscale: '' is not a number"),
        (GYROFLOW.replace("YxZ", "YYZ"), "orientation is 'YYZ'"),
        (GYROFLOW.replace("110", "nan"), "line 10: 'nan' is not a number"),
        (GYROFLOW.split("\n5,")[0], "rates for 1 times"),
        (GYROFLOW + "11,2\n", "line 14 has 2 values"),
        (BLACKBOX.replace("gyroADC[2]", "x"), r"no column gyroADC\[2\]"),
    ],
)
def test_a_file_that_is_no_log(tmp_path, text, message):
    with pytest.raises(SsiamError, match=message):
        read_gyro(written(tmp_path, text))


def test_a_missing_file(tmp_path):
    with pytest.raises(SsiamError, match="cannot be read"):
        read_gyro(tmp_path / "none.gcsv")


@pytest.mark.parametrize(
    ("times", "rates"),
    [([0.0], [[0, 0, 0]]), ([0, 0], np.zeros((2, 3))), ([0, 1], np.zeros((3, 3))), ("a", 1)],
)
def test_a_track_that_is_none(times, rates):
    with pytest.raises(ArgumentError):
        GyroTrack(times, rates)
