"""Run the same commands with two commits and compare what they write, byte by byte.

    python scripts/compare_commits.py BEFORE [AFTER] [--shared FOLDER] [--only NAME ...]

AFTER is HEAD unless given. Tracks, benchmarks, evaluates and trains on the example clip and on the
shared test data, prints each file that differs, and exits with 1 if any does. Durations, dates and
the paths of the two folders are left out. Help texts and messages are not compared, nor real-time
runs, which depend on the speed of the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
CLIP = "examples/shaky-walker.mp4"
WALKER = "53,114,26,66"
CHOICES = "off", "paper", "literal", "predict"
WEIGHTS = {f"nanotrack_v{n}": f"nanotrackv{n}" for n in (1, 2, 3)}

TRAINING = """
steps = 4
batch = 4
workers = 1
threads = 1
checkpoint_minutes = 0
log_every = 1
{network}
[optimiser]
warm_up = 2
{teacher}
[pairs.augment]
small = 0.2
[pairs.windows]
turned = 0.3
[[sources]]
layout = "tracks"
path = "{shared}/data/training/tracks"
only = ["vipseg/*", "zebrafish/test_A", "tudpairs/pair0*"]
[[sources]]
layout = "davis"
path = "{shared}/data/training/masks/davis2016"
"""
TEACHER = '[teacher]\nweights = "{shared}/data/weights/nanotrackv3"\n'
NETWORKS = {
    "fine-tuned": ('[network]\nbegin = "lite"\nfrozen_steps = 2', TEACHER),
    "lite": (
        '[network]\nbegin = "{shared}/data/weights/nanotrackv3/nanotrackv3.pth"',
        TEACHER + 'fear = "{shared}/data/weights/fear_xs"\nagreement = 0.6\n',
    ),
}


def commands(shared: Path, out: Path) -> dict[str, list[list[str]]]:
    """The commands of each comparison by its name; they write below `out`."""
    weights = shared / "data" / "weights"
    sequences = str(shared / "data" / "sequences")
    result: dict[str, list[list[str]]] = {}

    def track(name: str, tracker: str, *options: str) -> None:
        start = ["track", CLIP, "--box", WALKER, "--tracker", tracker, "--threads", "1"]
        files = [f"track-{name}.csv", f"track-{name}.jsonl"]
        result[f"track-{name}"] = [
            [*start, "--results", str(out / file), *options] for file in files
        ]

    for choice in CHOICES:
        track(f"lite-{choice}", "lite", "--stabilize", choice)
    for tracker, folder in WEIGHTS.items():
        track(tracker, tracker, "--weights", str(weights / folder))
    for tracker in ("csrt", "kcf", "mil"):
        track(tracker, tracker)
    for keypoints in ("orb", "gftt", "harris", "brisk", "mser"):
        track(f"lite-{keypoints}", "lite", "--stabilize", "paper", "--keypoints", keypoints)
    track("lite-least-squares", "lite", "--stabilize", "paper", "--fit", "least_squares")
    track("lite-plain", "lite", "--no-choose", "--no-speed", "--no-turn", "--no-trust", "--no-find")
    for layout in ("otb", "mot", "vot"):
        file = str(out / f"track-two-{layout}.txt")
        boxes = ["--box", WALKER, "--box", "200,60,40,60"]
        result[f"track-two-{layout}"] = [
            ["track", CLIP, *boxes, "--results", file, "--layout", layout, "--threads", "1"]
        ]
    for protocol in ("vot", "ope"):
        folder = str(out / f"bench-{protocol}")
        bench = ["bench", str(out / "sequences"), "--out", folder]
        bench += ["--trackers", "lite,nanotrack_v3"]
        bench += ["--weights", f"nanotrack_v3={weights / 'nanotrackv3'}", "--protocol", protocol]
        bench += ["--shake", "0,0.03"]
        result[f"bench-{protocol}"] = [bench]
        if protocol == "ope":  # VOT measures need frame sizes, which OTB folders do not give
            result[f"bench-{protocol}"].append(
                ["eval", folder, "--dataset", sequences, "--experiment", "ope", "--json"]
            )
    results = shared / "data" / "vot" / "results" / "VOT2018"
    dataset = str(shared / "data" / "vot" / "VOT2018.json")
    result["eval-vot2018"] = [["eval", str(results), "--dataset", dataset, "--json", "--compare"]]
    for name, (network, teacher) in NETWORKS.items():
        config = out / f"train-{name}.toml"
        text = TRAINING.format(network=network, teacher=teacher, shared="{shared}")
        config.write_text(text.replace("{shared}", str(shared)), encoding="utf-8")
        folder = str(out / f"train-{name}")
        result[f"train-{name}"] = [
            ["train", str(config), "--out", folder],
            ["train", str(config), "--out", folder, "--so-far", folder + "-so-far"],
        ]
    return result


def write_short_sequences(shared: Path, out: Path) -> None:
    """Write the first 40 frames of three sequences of the shared data."""
    for name in ("David", "Skiing", "dtb70_MountainBike6"):
        source = shared / "data" / "sequences" / name
        images = sorted((source / "img").iterdir())[:40]
        target = out / "sequences" / name
        (target / "img").mkdir(parents=True)
        for image in images:
            (target / "img" / image.name).symlink_to(image)
        for truth in source.glob("*.txt"):
            lines = truth.read_text().splitlines(keepends=True)
            (target / truth.name).write_text("".join(lines[:40]))


def run(tree: Path, arguments: list[str]) -> tuple[int, str]:
    """Run a command in a working tree; returns its exit code and standard output."""
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "OMP_WAIT_POLICY": "PASSIVE"}
    done = subprocess.run(
        [sys.executable, "-m", "ssiam", *arguments],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        print(f"    exit {done.returncode}: {' '.join(arguments)}\n{done.stderr[-300:]}")
    return done.returncode, done.stdout


def comparable(path: Path, out: Path) -> bytes:
    """A file's bytes without durations, dates and the path of the output folder `out`."""
    data = path.read_bytes().replace(str(out).encode(), b"OUT")
    if "times" in path.parts or path.name.endswith(("_time.value", "_time.txt")):
        return str(data.count(b"\n")).encode()
    if path.suffix in {".csv", ".json", ".jsonl", ".stdout"}:
        text = data.decode()
        text = re.sub(r'"[a-z_]*(?:ms|fps|seconds|date|time)": "?[-0-9.:T+ ]+"?', "", text)
        return re.sub(r"(?m)^.*(?:per_second|seconds).*$", "", text).encode()
    if path.suffix == ".pth":
        return tensors(path)
    return data


def tensors(path: Path) -> bytes:
    """The content of a PyTorch file in a comparable form, sorted by name."""
    import torch

    def flat(value: object) -> object:
        if isinstance(value, torch.Tensor):
            return value.double().numpy().tobytes() if value.numel() else b""
        if isinstance(value, dict):
            return sorted((str(key), flat(each)) for key, each in value.items())
        if isinstance(value, list | tuple):
            return [flat(each) for each in value]
        return value

    return repr(flat(torch.load(path, map_location="cpu", weights_only=False))).encode()


def differences(before: Path, after: Path) -> list[str]:
    """The files that are in one folder only or differ, and the failed commands."""
    names = {
        str(path.relative_to(folder))
        for folder in (before, after)
        for path in folder.rglob("*")
        if path.is_file() and "events.out" not in path.name and "sequences" not in path.parts
    }
    found = []
    for name in sorted(names):
        pair = before / name, after / name
        if not all(path.exists() for path in pair):
            found.append(f"{name}: only {'before' if pair[0].exists() else 'after'}")
        elif name.endswith(".exit") and any(json.loads(pair[1].read_text())):
            found.append(f"{name}: a command failed")
        elif comparable(pair[0], before) != comparable(pair[1], after):
            found.append(f"{name}: differs")
    return found


def outputs(commit: str, folder: Path, shared: Path, only: list[str]) -> Path:
    """Run all commands with a commit; returns the folder of their outputs, below `folder`."""
    tree = folder / f"tree-{commit[:10].replace('/', '-')}"
    subprocess.run(
        ["git", "worktree", "add", "--detach", "--force", str(tree), commit],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    out = folder / f"out-{tree.name}"
    out.mkdir()
    write_short_sequences(shared, out)
    try:
        for name, calls in commands(shared, out).items():
            if only and name not in only:
                continue
            codes = []
            for number, arguments in enumerate(calls):
                code, text = run(tree, arguments)
                codes.append(code)
                if arguments[0] == "eval":
                    (out / f"{name}-{number}.stdout").write_text(text, encoding="utf-8")
            (out / f"{name}.exit").write_text(json.dumps(codes), encoding="utf-8")
            print(f"{commit[:10]} {name} {codes}", flush=True)
    finally:
        subprocess.run(["git", "worktree", "remove", "--force", str(tree)], cwd=ROOT, check=True)
    return out


def main() -> None:
    """Compare two commits."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("before")
    parser.add_argument("after", nargs="?", default="HEAD")
    default = os.environ.get("SSIAM_SHARED", str(ROOT.parent / "shared"))
    parser.add_argument("--shared", type=Path, default=Path(default))
    parser.add_argument("--only", nargs="*", default=[], help="names of comparisons")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        before, after = (
            outputs(commit, Path(name), args.shared.resolve(), args.only)
            for commit in (args.before, args.after)
        )
        found = differences(before, after)
        compared = sum(1 for path in after.rglob("*") if path.is_file())
    print(*found, f"{compared} files compared, {len(found)} differ", sep="\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
