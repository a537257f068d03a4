"""Look the packages of an environment up in the list of known vulnerabilities, with pip-audit.

    make audit
    python scripts/audit.py [SITE-PACKAGES]        # with a Python that has pip-audit

Exit codes: 0 none known; 1 some, each with the version that mends it; 2 not looked up.
pip-audit itself ends with 0 where its database knows none of the packages, as behind a mirror.
"""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

NOT_AUDITED = 2
# Installed from here, not from an index
LOCAL = ("ssiam",)
SECONDS = 600


def audited(folder: Path) -> tuple[int, list[str]]:
    """Exit code and lines of the report about the packages in `folder`."""
    command = [sys.executable, "-m", "pip_audit", "--path", str(folder), "--format", "json"]
    try:
        done = subprocess.run(
            [*command, "--progress-spinner", "off"], capture_output=True, text=True, timeout=SECONDS
        )
    except subprocess.TimeoutExpired:
        return NOT_AUDITED, [f"audit: not done: no answer within {SECONDS} seconds; try again"]
    try:
        return summary(json.loads(done.stdout)["dependencies"])
    except (ValueError, KeyError, TypeError):
        reason = (done.stderr.strip() or "no report").splitlines()[-1]
        return NOT_AUDITED, [f"audit: not done: {reason[:300]}; is the network reachable?"]


def summary(packages: list[dict[str, Any]]) -> tuple[int, list[str]]:
    """Exit code and lines for the packages of pip-audit's JSON report."""
    packages = [each for each in packages if each["name"] not in LOCAL]
    known = [each for each in packages if "skip_reason" not in each]
    if not known:
        return NOT_AUDITED, [
            f"audit: not done: the database has none of the {len(packages)} packages; a mirror of "
            "PyPI has no list of vulnerabilities: run it where pypi.org is reachable"
        ]
    lines = [
        f"{package['name']} {package['version']}: {found['id']}, "
        f"mended in {', '.join(found['fix_versions']) or 'no version yet'}"
        for package in known
        for found in package["vulns"]
    ]
    unknown = [each["name"] for each in packages if "skip_reason" in each]
    end = f"; not looked up: {', '.join(unknown)}" if unknown else ""
    total = f"audit: {len(lines) or 'no'} known vulnerabilities in {len(known)} packages{end}"
    return int(bool(lines)), [*lines, total]


def main() -> int:
    """Audit the folder given on the command line, or this Python's packages."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else sysconfig.get_paths()["purelib"])
    code, lines = audited(folder)
    print("\n".join(lines), file=sys.stderr if code == NOT_AUDITED else sys.stdout)
    return code


if __name__ == "__main__":
    sys.exit(main())
