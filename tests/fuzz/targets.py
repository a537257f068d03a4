"""Each reader and socket, with valid inputs; a `SsiamError` is the only way to refuse one."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import islice
from pathlib import Path

import av
import cv2
import numpy as np

from fuzz.network_targets import network_targets
from fuzz.server_targets import server_targets
from fuzz.stream_targets import stream_targets
from fuzz.target import Target, in_file, latin, or_value_error, text
from helpers import datasets_on_disk as on_disk
from helpers import message_fuzz
from helpers.drawn_datasets import write_pysot_json
from helpers.written_results import FPS, ROW, SIZE, csv_of
from ssiam.addresses import display_name, redact_words
from ssiam.cli.boxes import parse_boxes
from ssiam.cli.moments import parse_moment
from ssiam.cli.static_areas import StaticAreas
from ssiam.datasets import open_dataset
from ssiam.evaluation.runs.entries import entries
from ssiam.evaluation.runs.identity import read_identity
from ssiam.evaluation.runs.result_files import read_boxes, read_vot
from ssiam.evaluation.runs.shaken_results import read_shake
from ssiam.evaluation.vot.workspace import left_out, write_workspace
from ssiam.exchange import EXPORT_KINDS, read_annotations, read_corrections, write_exports
from ssiam.geometry import check_box
from ssiam.motion import Motion, read_gyro
from ssiam.parsing import parse_json, parse_rate
from ssiam.runtime.manifest import Manifest
from ssiam.toml_tables import read_toml
from ssiam.trackers.one_stream import OneStreamDescription
from ssiam.video import open_source
from ssiam.video.mask_codec import decode_mask, encode_mask
from ssiam.video.source_files import check_distinct_from_source
from ssiam.web.feeds.pushed import decode_jpeg
from ssiam.web.mavlink.commands import CommandReader
from ssiam.web.picking.service import PickService
from ssiam.web.recording_files import RecordingFolder
from ssiam.web.server.guard import Access
from ssiam.web.server.incoming import parse_message

_IMAGE = np.tile(np.arange(24, dtype=np.uint8)[:, None, None] * 9, (1, 32, 3))
_SETTINGS = b"""seed = 1
steps = 10
batch = 4
[[sources]]
layout = "davis"
path = "x"
weight = 1.5
[optimiser]
lr = 0.001
"""


def all_targets(folder: Path) -> list[Target]:
    """Every reader and socket; they write their inputs into `folder`."""
    return [
        *_result_targets(folder / "results"),
        *_dataset_targets(folder / "datasets"),
        *_image_targets(folder / "images"),
        *_text_targets(folder / "texts"),
        *_socket_targets(),
        *_network_targets(folder / "networks"),
        *network_targets(folder / "onnx"),
        *server_targets(folder / "servers"),
        *stream_targets(folder / "streams"),
    ]


def _result_targets(folder: Path) -> Iterable[Target]:
    def export(path: Path) -> None:
        annotations = read_annotations(path, SIZE, FPS)
        if annotations.frame_count < 2000:
            for kind in EXPORT_KINDS:
                write_exports(annotations, folder / "out", kind)

    rows = csv_of({}, {"frame": "4", "lost": "1"}, {"target": "2"}).encode()
    line = json.dumps({key: float(value) if value else None for key, value in ROW.items()})
    yield Target("results.csv", (rows,), in_file(folder / "r.csv", export))
    yield Target("results.jsonl", (line.encode() * 1 + b"\n",), in_file(folder / "r.jsonl", export))
    yield from _correction_targets(folder)
    vot = (b"1\n10,20,30,40\n2\n0\n1,2,3,4,5,6,7,8\n", b"1\n1.5,2.5,3,4\nnan,nan,nan,nan\n")
    yield Target("results of VOT", vot, in_file(folder / "a_001.txt", read_vot))
    boxes = (b"1,2,3,4\n5,6,7,8\n", b"1\t2\t3\t4\n")
    gyro = (
        b"GYROFLOW IMU LOG\norientation,YxZ\ntscale,1\ngscale,1\nt,gx,gy,gz\n0,1,2,3\n5,4,5,6\n",
        b"time (us), gyroADC[0], gyroADC[1], gyroADC[2] (deg/s)\n10, 1, 2, 3\n510, 4, 5, 6\n",
    )
    yield Target("gyro log", gyro, in_file(folder / "g.gcsv", read_gyro))
    yield Target("results of OTB", boxes, in_file(folder / "a.txt", read_boxes))
    identity = {"weights_sha256": "0" * 64, "runtime": "openvino", "device": "cpu"}
    identity |= {"precision": "f32", "threads": 1}
    run = json.dumps(identity).encode()
    yield Target(
        "run.json", (run,), in_file(folder / "t/run.json", lambda p: read_identity(p.parent))
    )
    shake = {"strength": 0.03, "kind": "handheld", "seed": 0, "exposure": 0.0, "readout": 0.0}
    text = json.dumps(shake | {"border": "reflect"}).encode()
    yield Target(
        "shake.json", (text,), in_file(folder / "t/shake.json", lambda p: read_shake(p.parent))
    )
    recording = {"fps": "30000/1001", "size_wh": [64, 48], "frames": 5, "seconds": 0.2}
    recording |= {"names": {"1": "boat"}, "whole": True, "error": ""}

    def read_recording(path: Path) -> object:
        return RecordingFolder(path.parent).read_metadata()

    yield Target(
        "recording.json",
        (json.dumps(recording).encode(),),
        in_file(folder / "rec/recording.json", read_recording),
    )


def _correction_targets(folder: Path) -> Iterable[Target]:
    """What annotation tools give back, and masks."""
    rows = csv_of({}, {"frame": "1", "lost": "1"}, {"target": "2"})
    (folder / "given.csv").parent.mkdir(parents=True, exist_ok=True)
    (folder / "given.csv").write_text(rows)
    annotations = read_annotations(folder / "given.csv", SIZE, FPS)
    for kind, name in (("cvat", "c.xml"), ("labelstudio", "c.json")):
        write_exports(annotations, folder / name, kind)

        def read(path: Path) -> object:
            return read_corrections(path, SIZE, FPS)

        seeds = ((folder / name).read_bytes(),)
        yield Target(f"corrections of {kind}", seeds, in_file(folder / f"read-{name}", read), 4)

    mask = np.zeros((24, 32), np.bool_)
    mask[3:9, 5:20] = True
    decode = or_value_error(text(lambda text: decode_mask(text, (32, 24))))
    yield Target("mask", (encode_mask(mask).encode(),), decode)


def _dataset_targets(folder: Path) -> Iterable[Target]:
    def layout(name: str, file: Path, root: Path, kind: str | None = None) -> Target:
        valid = file.read_bytes()

        def read(_: Path) -> None:
            try:
                dataset = open_dataset(root, kind)
                for each in islice(dataset.sequences, 3):
                    sequence = dataset.sequences[each]
                    list(islice(sequence.images(), 1))
            finally:
                file.write_bytes(valid)  # other targets read it too

        return Target(name, (valid,), in_file(file, read), 4)

    otb = on_disk.write_otb(folder / "otb", "Car", range(1, 4), on_disk.boxes(3))
    yield layout("OTB", otb / "groundtruth_rect.txt", folder / "otb")
    on_disk.write_vot(folder / "vot", "bag", polygon=True)
    yield layout("VOT", folder / "vot/bag/groundtruth.txt", folder / "vot")
    on_disk.write_uav123(folder / "uav", "bike1", "bike1", range(1, 4), on_disk.boxes(3))
    yield layout("UAV123", folder / "uav/anno/UAV123/bike1.txt", folder / "uav")
    got10k = on_disk.write_got10k(folder / "got", "val", 1)
    yield layout("GOT-10k", got10k / "groundtruth.txt", folder / "got")
    yield layout("GOT-10k list", folder / "got/val/list.txt", folder / "got")
    lasot = on_disk.write_lasot(folder / "lasot", "airplane-1")
    yield layout("LaSOT", lasot / "groundtruth.txt", folder / "lasot")
    yield layout("LaSOT flags", lasot / "full_occlusion.txt", folder / "lasot")
    lines = [(frame, 1, 2, 3, 5, 4, 1, 1, 1) for frame in range(1, 5)]
    mot = on_disk.write_mot(folder / "mot", "MOT17-02", lines)
    yield layout("MOT", mot / "gt/gt.txt", folder / "mot")
    yield layout("MOT seqinfo", mot / "seqinfo.ini", folder / "mot")
    yield from _clip_targets(folder, layout)
    (folder / "pysot").mkdir()
    pysot = write_pysot_json(folder / "pysot/VOT2018.json", {"bag": 2})
    yield layout("pysot", pysot, pysot)


def _clip_targets(folder: Path, layout: Callable[..., Target]) -> Iterable[Target]:
    """DTB70, clips of users, and VOT in the layout of the newer toolkit, with its workspace."""
    dtb70 = on_disk.write_otb(folder / "dtb70", "Car4", range(1, 4), on_disk.boxes(3), digits=5)
    yield layout("DTB70", dtb70 / "groundtruth_rect.txt", folder / "dtb70", "dtb70")
    walk = folder / "clips/walk"
    on_disk.write_images(walk, range(1, 4), 4)
    (walk / "boxes.txt").write_text(on_disk.text(on_disk.boxes(3)))
    yield layout("clip", walk / "boxes.txt", walk, "clip")
    tags = {"occlusion.tag": (0, 1, 0)}
    newer = on_disk.write_vot(folder / "vot2020", "bag", toolkit=True, tags=tags)
    yield layout("VOT sequence", newer / "sequence", folder / "vot2020")
    yield layout("VOT tag", newer / "occlusion.tag", folder / "vot2020")
    competitors = entries(["kcf"], ["off"], {})

    def workspace(name: str, file: str, stack: str | None = None) -> Target:
        sequences = folder / name / "sequences"
        on_disk.write_vot(sequences, "bag")
        (sequences / "list.txt").write_text("bag\n")
        (folder / name / "given.yaml").write_text("title: a\nexperiments: {}\n")
        chosen = None if stack is None else str(folder / name / stack)

        def write(_: Path) -> None:
            left_out(folder, sequences)
            target = folder / name / "written"
            write_workspace(target, competitors, stack=chosen, sequences=sequences, force=True)

        path = folder / name / file
        return Target(f"VOT workspace's {name}", (path.read_bytes(),), in_file(path, write), 2)

    yield workspace("list", "sequences/list.txt")
    yield workspace("truth", "sequences/bag/groundtruth.txt")
    yield workspace("stack", "given.yaml", "given.yaml")


def _image_targets(folder: Path) -> Iterable[Target]:
    def frames(path: Path) -> None:
        with suppress(StopIteration), open_source(path) as source:
            for _ in range(4):
                next(source)

    def encoded(suffix: str, *flags: int) -> bytes:
        return cv2.imencode(suffix, _IMAGE, flags)[1].tobytes()

    still = tuple(encoded(suffix) for suffix in (".png", ".jpg", ".bmp", ".webp"))
    yield Target("image", still, in_file(folder / "still/a.png", lambda p: frames(p.parent)))
    pages = cv2.imencodemulti(".tiff", [_IMAGE, _IMAGE[..., 0]])[1].tobytes()
    tiff = (pages, encoded(".tiff", cv2.IMWRITE_TIFF_COMPRESSION, 1))
    yield Target("TIFF", tiff, in_file(folder / "a.tiff", frames))
    for suffix, codec in (("mp4", "libx264"), ("avi", "mjpeg"), ("mkv", "ffv1"), ("gif", "gif")):
        data = _video(suffix, codec)
        yield Target(suffix, (data,), in_file(folder / f"clip.{suffix}", frames), 1)
    playlist = b"#EXTM3U\n#EXTINF:1,\nclip.mp4\n"
    concat = b"ffconcat version 1.0\nfile clip.mp4\n"

    def check(path: Path) -> None:
        check_distinct_from_source([("--out", folder / "o.mp4")], str(path))

    yield Target("playlist", (playlist, concat), in_file(folder / "l.m3u8", check))
    yield Target("browser's JPEG", (encoded(".jpg"),), decode_jpeg)


def _video(suffix: str, codec: str) -> bytes:
    file = io.BytesIO()
    formats = {"mkv": "matroska"}
    with av.open(file, "w", format=formats.get(suffix, suffix)) as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height = 64, 48
        stream.pix_fmt = {"mjpeg": "yuvj420p", "gif": "rgb8"}.get(codec, "yuv420p")
        for shade in (20, 90, 200):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), shade, np.uint8), "bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return file.getvalue()


def _text_targets(folder: Path) -> Iterable[Target]:
    def area_mask(text: str) -> object:
        return StaticAreas.parse([text]).mask((32, 24))

    boxes = b"frame,x,y,w,h\n0,1,2,3,4\n12,5,6,7,8\n"
    yield Target("boxes.csv", (boxes,), in_file(folder / "b.csv", lambda p: parse_boxes([f"@{p}"])))
    words = (b"10,20,30,40", b"300:1,2,3,4", b"0:12:1,2,3,4", b"12s:1,2,3,4")
    yield Target("box", words, text(lambda text: parse_boxes([text.replace("@", "")])))
    areas = (b"1,2,3,4", b"-5,-5.5,1e3,9", b"0,0,32,12")
    yield Target("static area", areas, text(lambda text: area_mask(text.replace("@", ""))))
    area = cv2.imencode(".png", _IMAGE)[1].tobytes()
    yield Target(
        "static area.png", (area,), in_file(folder / "s.png", lambda p: area_mask(f"@{p}"))
    )
    yield Target("moment", (b"300", b"12.5s", b"1:02:03.5"), text(parse_moment))
    addresses = (b"rtsp://user:pass@host:554/a?b=c#d", b"http://[::1]:80/x", b"file:///a%20b")

    def redact(text: str) -> object:
        return display_name(text), redact_words(text, [text])

    yield Target("address", addresses, text(redact))
    yield Target("JSON", (b'{"a": [1, 2.5, "\\u00e9"]}',), or_value_error(parse_json))
    yield Target("rate", (b"30000/1001", b"29.97"), or_value_error(text(parse_rate)))

    def numbers(text: str) -> list[float]:
        values = []
        for word in text.split(","):
            with suppress(ValueError):
                values.append(float(word))
        return values

    def box(text: str) -> None:
        check_box(numbers(text), (64, 48))

    def motion(text: str) -> None:
        values = numbers(text)
        Motion.from_transform(np.resize(values or [0.0], (3, 3)), (64, 48)).shift_angle  # noqa: B018

    yield Target("target box", (b"10,20,30,40",), text(box))
    yield Target("motion", (b"1,0.1,5,-0.1,1,3,0.0001,0,1",), text(motion))


def _socket_targets() -> Iterable[Target]:
    messages = tuple(json.dumps(message).encode() for _, message, _ in message_fuzz.GOOD)
    yield Target("page's message", messages, text(parse_message))
    pick = [
        {"type": "add", "frame": 3, "box": [1, 2, 3, 4], "id": 1},
        {"type": "click", "frame": 3, "point": [1.5, 2], "ask": 4},
        {"type": "adjust", "id": 1, "box": [1, 2, 3, 4], "frame": 3},
        {"type": "absent", "id": 1, "frame": 3},
        {"type": "seek", "index": 9},
        {"type": "preview", "id": 1},
        {"type": "remove", "id": 1, "frame": 3},
    ]
    service = PickService(None, lambda count: None)  # `parse` needs no session
    commands = tuple(json.dumps(message).encode() for message in pick)
    yield Target("picking page's message", commands, text(service.parse))
    access = Access(8000, frozenset({"cam.local"}), token="secret")

    def headers(text: str) -> None:
        access.accepts_host(text)
        access.accepts_token(text)

    yield Target("Host and token", (b"localhost:8000", b"[::1]:8000", b"secret"), latin(headers))
    reader = CommandReader(255, 100)
    yield Target(
        "MAVLink", (_packet(),), lambda data: list(reader.commands(data, is_complete=True))
    )


def _packet() -> bytes:
    from pymavlink.dialects.v20 import common as mavlink

    sender = mavlink.MAVLink(None, srcSystem=254, srcComponent=190)
    message = mavlink.MAVLink_command_long_message(255, 100, 2004, 0, 0.5, 0.5, 0.1, 0, 0, 0, 0)
    return bytes(message.pack(sender))


def _network_targets(folder: Path) -> Iterable[Target]:
    manifest = {"name": "siamfc", "network": "siamfc", "sha256": "0" * 64, "pieces": ["template"]}
    text = json.dumps(manifest | {"precision": "f32", "opset": 17, "ssiam": "1"}).encode()
    yield Target(
        "network.json",
        (text,),
        in_file(folder / "network.json", lambda p: Manifest.read(p.parent)),
    )
    import torch

    from ssiam.networks.checkpoints import read_checkpoint
    from ssiam.training.config import read_config

    def saved(zipped: bool) -> bytes:
        file = io.BytesIO()
        state = {"state_dict": {"a.weight": torch.zeros(3, 2)}, "epoch": 3}
        torch.save(state, file, _use_new_zipfile_serialization=zipped)
        return file.getvalue()

    pth = (saved(True), saved(False))
    yield Target("checkpoint", pth, in_file(folder / "a.pth", read_checkpoint), 4)
    yield Target("config", (_SETTINGS,), in_file(folder / "c.toml", read_config))
    yield Target(
        "description",
        (b'network = "a.onnx"\nwindow = 0.5\nmean = [0.4, 0.5, 1]\noutputs = ["box", "score"]\n',),
        in_file(folder / "d.toml", lambda p: read_toml(OneStreamDescription, p, "description")),
    )
    yield from _training_targets(folder / "training")


def _training_targets(folder: Path) -> Iterable[Target]:
    from helpers.sets_on_disk import BOX, open_set, write_coco, write_davis, write_voc
    from ssiam.training.data.images import read_labels

    def set_of(layout: str, path: Path, file: Path, seeds: tuple[bytes, ...] = ()) -> Target:
        read = in_file(file, lambda _: open_set(layout, path))
        return Target(f"training set {layout}", seeds or (file.read_bytes(),), read, 4)

    voc = write_voc(folder / "voc", {"1": [("car", ("20", "30", "60", "50"))]})
    yield set_of("voc", voc, voc / "Annotations/1.xml")
    polygon = [10.0, 10.0, 40.0, 10.0, 40.0, 40.0]
    entry = {"image_id": 1, "bbox": list(BOX), "segmentation": [polygon], "iscrowd": 0}
    counts = {"counts": "04N02", "size": [24, 32]}
    coco = write_coco(folder / "coco", [entry, entry | {"segmentation": counts}])
    yield set_of("coco", coco, coco)
    (folder / "yolo/images").mkdir(parents=True)
    cv2.imwrite(str(folder / "yolo/images/1.png"), _IMAGE)
    lines = (b"0 0.5 0.5 0.2 0.2\n1 0.1 0.1 0.4 0.1 0.4 0.4\n",)
    meta = {"videos": {"v": {"objects": {"1": {"category": "cat", "frames": ["00000"]}}}}}
    for inner in ("JPEGImages", "Annotations"):
        (folder / "youtube" / inner / "v").mkdir(parents=True)
        cv2.imwrite(str(folder / "youtube" / inner / "v/00000.png"), _IMAGE[..., 0])
        cv2.imwrite(str(folder / "youtube" / inner / "v/00000.jpg"), _IMAGE)
    youtube = (json.dumps(meta).encode(),)
    yield set_of("youtube_vos", folder / "youtube", folder / "youtube/meta.json", youtube)
    track = folder / "tracks/park/1"
    track.mkdir(parents=True)
    for number in (1, 2):
        cv2.imwrite(str(track / f"{number:08}.png"), _IMAGE)
    (track / "groundtruth.txt").write_text("1,2,5,6\n2,3,5,6\n")
    (track / "absence.label").write_text("0\n0\n")
    regions = [[0, 0, 32, 24, 1.0], [0, 0, 32, 24, 1.0]]
    park = {"video": "park", "track_id": 1, "category": "person", "frames": [0, 3]}
    park["crop_windows_x0y0x1y1_scale"] = regions
    tracks = (json.dumps(park).encode(),)
    yield set_of("tracks", folder / "tracks", track / "meta.json", tracks)
    frames = write_voc(folder / "voc_video", {"1": [("car", ("20", "30", "60", "50"))]})
    yield set_of("voc_video", frames, frames / "Annotations/1.xml")
    rows = [(frame, 1, 2, 3, 15, 14, 1, 1, 1) for frame in range(1, 5)]
    people = on_disk.write_mot(folder / "mot", "MOT17-02", rows)
    yield set_of("mot", folder / "mot", people / "gt/gt.txt")
    davis = write_davis(folder / "davis")
    yield set_of("davis", davis, davis / "Annotations/480p/bear/00000.png")
    labels = cv2.imencode(".png", _IMAGE[..., 0])[1].tobytes()
    yield Target("labels", (labels,), in_file(folder / "labels.png", read_labels))
    yield set_of("yolo", folder / "yolo", folder / "yolo/labels/1.txt", lines)
