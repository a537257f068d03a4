"""The wheel is whole without the checkout: it is built, installed and used from another folder."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from email import message_from_string
from pathlib import Path

import pytest

import ssiam

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
SECONDS = 240


def pip(*arguments, env=None):
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, env=env)
    if "No matching distribution found for hatchling" in done.stderr:
        pytest.skip("pip cannot get hatchling, which builds the wheel: pip install hatchling")
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the installed wheel."""
    built, target = (tmp_path_factory.mktemp(name) for name in ("built", "target"))
    here = ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []
    pip("wheel", "--no-deps", *here, "-w", built, ROOT)
    pip("install", "--no-deps", "--target", target, *built.glob("*.whl"))
    return target


@pytest.fixture
def run(installed, tmp_path):
    """Run Python with the installed wheel in an empty folder; returns what it prints."""

    def run(*arguments, code=0):
        done = subprocess.run(
            [sys.executable, *map(str, arguments)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            env=os.environ | {"PYTHONPATH": str(installed)},
        )
        assert done.returncode == code, done.stderr
        return done.stdout + done.stderr

    return run


def test_the_program_tells_its_version(run, installed):
    for command in (["-m", "ssiam"], [installed / "bin" / "ssiam"]):
        assert run(*command, "--version") == f"{ssiam.__version__}\n"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_kernel_is_compiled_for_the_platform_alone(run, installed):
    assert run("-m", "ssiam", "--version", "-v").splitlines()[1] == "camera motion: compiled"
    (wheel,) = installed.glob("ssiam-*.dist-info/WHEEL")
    tags = message_from_string(wheel.read_text(encoding="utf-8")).get_all("Tag")
    assert [tag.rsplit("-", 1)[0] for tag in tags] == ["py3-none"]
    assert not tags[0].endswith("-any")


def test_without_a_compiler_the_installation_is_whole_and_says_so_once(tmp_path):
    built = tmp_path / "built"
    here = ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []
    environment = os.environ | {"CC": "no-such-compiler"}
    pip("wheel", "--no-deps", *here, "-w", built, ROOT, env=environment)
    (wheel,) = built.glob("*.whl")
    assert wheel.name.endswith("-py3-none-any.whl")
    pip("install", "--no-deps", "--target", tmp_path / "target", wheel)
    code = (
        "import numpy as np, ssiam\n"
        "frame = np.random.default_rng(0).integers(0, 256, (120, 160, 3), np.uint8)\n"
        "for _ in range(2):\n"
        "    camera = ssiam.CameraMotion(); camera.update(frame); print(camera.update(frame))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "target")},
    )
    assert done.stdout.count("Motion(dx=0.0, dy=0.0") == 2, done.stderr
    assert done.stderr.count("camera motion runs in NumPy") == 1


def test_the_default_tracker_runs(run, installed):
    code = (
        "import numpy as np, ssiam; print(ssiam.__file__)\n"
        "tracker = ssiam.load_tracker()\n"
        "frame = np.random.default_rng(0).integers(0, 256, (120, 160, 3), np.uint8)\n"
        "tracker.init(frame, (40, 30, 32, 32)); print(tracker.update(frame))"
    )
    file, track = run("-c", code).splitlines()
    assert Path(file).is_relative_to(installed)
    assert track.startswith("Track(box=(")


def test_the_page_is_served_with_all_its_files(run):
    pytest.importorskip("starlette")
    code = (
        "import sys, ssiam; from urllib.request import urlopen; from ssiam.web import Session\n"
        "from ssiam.web.server.serving import LiveServer\n"
        "session = Session.open('browser', ssiam.load_tracker('kcf'))\n"
        "with session, LiveServer(session, port=0) as server:\n"
        "    base = server.address.partition('#')[0].rstrip('/')\n"
        "    for name in ['', *sys.argv[1:]]:\n"
        "        print(urlopen(f'{base}/{name and \"page/\" + name}').status)"
    )
    names = sorted(path.name for path in (ROOT / "src/ssiam/web/page").iterdir() if path.is_file())
    assert run("-c", code, *names).split() == ["200"] * (len(names) + 1)


def test_the_configs_are_named_where_there_is_no_checkout(run, installed):
    pytest.importorskip("torch")
    message = run("-m", "ssiam", "train", "configs/lite.toml", code=2)
    (shipped,) = re.findall(r"; (\S*lite\.toml) is one to copy", message)
    assert Path(shipped).is_relative_to(installed)
    assert Path(shipped).read_bytes() == (ROOT / "configs" / "lite.toml").read_bytes()


def test_the_description_needs_no_other_file(installed):
    (path,) = installed.glob("ssiam-*.dist-info/METADATA")
    metadata = message_from_string(path.read_text(encoding="utf-8"))
    assert metadata["Description-Content-Type"] == "text/markdown"
    text = metadata.get_payload()
    for target in re.findall(r"\]\(([^)]*)\)", text):
        assert re.match(r"https?://", target), target
    assert "\npip install ssiam\n" in text
    assert "\npip install 'ssiam[web]'" in text
    assert "pip install ." not in text


def test_all_versions_are_the_same(installed):
    (path,) = installed.glob("ssiam-*.dist-info/METADATA")
    assert message_from_string(path.read_text(encoding="utf-8"))["Version"] == ssiam.__version__
    assert f"\nversion: {ssiam.__version__}\n" in (ROOT / "CITATION.cff").read_text()


def test_files_of_the_source_distribution_exist():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for pattern in project["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]:
        assert list(ROOT.glob(pattern.lstrip("/"))), pattern
