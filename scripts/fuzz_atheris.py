"""Fuzz one reader or socket guided by the code that its inputs reach.

    python scripts/fuzz_atheris.py TARGET [-max_total_time=60 and other options of libFuzzer]

Needs Atheris (`pip install atheris`; Linux). Without a known TARGET the names are printed. The
first exception that is not a `SsiamError` ends the run; its input is in build/fuzz/.
`scripts/fuzz.py` damages the inputs of all targets blindly.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "src")]

with atheris.instrument_imports(include=["ssiam"]):
    from fuzz.target import failure
    from fuzz.targets import all_targets


def main(arguments: list[str]) -> None:
    """Fuzz until the time is over, or an exception is found."""
    with tempfile.TemporaryDirectory() as folder:
        targets = {target.name: target for target in all_targets(Path(folder))}
        name = arguments[0] if arguments else ""
        if name not in targets:
            sys.exit(f"{name!r} is not a target: choose from {', '.join(targets)}")
        target = targets[name]
        corpus = ROOT / "build" / "fuzz" / "corpus" / name.replace(" ", "_")
        corpus.mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(target.seeds):
            (corpus / f"seed-{number}").write_bytes(seed)

        def fuzz(data: bytes) -> None:
            error = failure(target, data)
            if error is not None:
                raise error

        found = f"-artifact_prefix={ROOT / 'build' / 'fuzz'}/"
        atheris.Setup([sys.argv[0], str(corpus), found, *arguments[1:]], fuzz)
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1:])
