"""Run the adapters of src/ssiam/integrations inside of the real trackers that they are made for.

    python scripts/hosts.py [HOST ...] [--environments DIR]

Each host is installed with pip into a virtual environment of its own, DIR/HOST, and the tests in
tests/hosts/test_HOST.py run there on this checkout. ultralytics and boxmot are under the AGPL and
are no dependencies of anything here. They are installed without what only their networks need;
nothing of them is replaced. The exit code is 1 if a test fails and 2 if a host cannot be
installed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from benchmarks.common.environments import EstimatorFailed, environment  # noqa: E402
from benchmarks.common.host_packages import ENVIRONMENTS, REQUIREMENTS  # noqa: E402


def main() -> int:
    """Install and test the hosts in turn."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("hosts", nargs="*", metavar="HOST", help=f"of {', '.join(REQUIREMENTS)}")
    parser.add_argument("--environments", type=Path, default=ENVIRONMENTS, metavar="DIR")
    options = parser.parse_args()
    if unknown := sorted({*options.hosts} - {*REQUIREMENTS}):
        parser.error(f"{unknown[0]} is no host: choose from {', '.join(REQUIREMENTS)}")
    codes = [_test(host, options.environments) for host in options.hosts or REQUIREMENTS]
    return max(codes)


def _test(host: str, environments: Path) -> int:
    try:
        python = environment(host, REQUIREMENTS[host], environments)
    except EstimatorFailed as error:
        print(f"{host}: {error}")
        return 2
    print(f"{host}:", flush=True)
    tests = ROOT / "tests" / "hosts" / f"test_{host}.py"
    done = subprocess.run(
        [python, "-m", "pytest", "-p", "no:cacheprovider", "-rs", tests],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
    )
    return 1 if done.returncode else 0


if __name__ == "__main__":
    sys.exit(main())
