"""Lower bounds exclude versions with known vulnerabilities; `make audit` never passes unlooked."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# The first version without the vulnerability.
MENDED = {
    "dask[distributed]": ("2026.1.1", "CVE-2026-23528"),
    "h11": ("0.16", "CVE-2025-43859"),
    "onnx": ("1.21", "CVE-2026-27489"),
    "opencv-contrib-python-headless": ("4.12", "CVE-2025-53644"),
    "playwright": ("1.55.1", "CVE-2025-59288"),
    "protobuf": ("6.31.1", "CVE-2025-4565"),
    "pytest": ("9.0.3", "CVE-2025-71176"),
    "starlette": ("1.3.1", "CVE-2025-62727, CVE-2026-48710, CVE-2026-54283"),
    "torch": ("2.10", "CVE-2026-24747"),
    "tornado": ("6.5.3", "CVE-2025-47287, CVE-2025-67724, CVE-2025-67725"),
}


def _numbers(version):
    return tuple(int(number) for number in version.split("."))


def _requirements():
    extras = PROJECT["optional-dependencies"].values()
    for text in (*PROJECT["dependencies"], *(each for extra in extras for each in extra)):
        found = re.match(r"([\w.-]+(?:\[\w+\])?)(>=|==)([0-9.]+)(?![0-9.]*\*)", text)
        if found:
            yield found[1], found[3]


@pytest.mark.parametrize("name", MENDED)
def test_lower_bounds_exclude_vulnerable_versions(name):
    bounds = [bound for package, bound in _requirements() if package == name]
    assert bounds
    for bound in bounds:
        assert _numbers(bound) >= _numbers(MENDED[name][0]), MENDED[name][1]


@pytest.fixture(scope="module")
def audit():
    spec = importlib.util.spec_from_file_location("audit", ROOT / "scripts" / "audit.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SKIPPED = {"name": "numpy", "skip_reason": "Dependency not found on PyPI"}
CLEAN = {"name": "rich", "version": "15.0.0", "vulns": []}
FOUND = {
    "name": "torch",
    "version": "2.9.1",
    "vulns": [
        {"id": "CVE-2026-24747", "fix_versions": ["2.10.0"], "aliases": [], "description": ""},
        {"id": "CVE-2025-3000", "fix_versions": [], "aliases": [], "description": ""},
    ],
}


def test_audit_names_what_mends_each_vulnerability(audit):
    assert audit.summary([CLEAN, FOUND]) == (
        1,
        [
            "torch 2.9.1: CVE-2026-24747, mended in 2.10.0",
            "torch 2.9.1: CVE-2025-3000, mended in no version yet",
            "audit: 2 known vulnerabilities in 2 packages",
        ],
    )


def test_audit_passes_only_what_was_looked_up(audit):
    code, lines = audit.summary([CLEAN, SKIPPED])
    assert (code, len(lines)) == (0, 1)
    assert lines[0].endswith("no known vulnerabilities in 1 packages; not looked up: numpy")
    code, lines = audit.summary([SKIPPED, {"name": "ssiam", "skip_reason": "not on PyPI"}])
    assert (code, len(lines)) == (2, 1)
    assert "none of the 1 packages" in lines[0]


def test_audit_without_an_answer_is_one_line(audit, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    code, lines = audit.audited(tmp_path)
    assert (code, len(lines)) == (2, 1)
    assert lines[0].startswith("audit: not done: ")
