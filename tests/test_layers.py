"""The import rules of docs/explanation/architecture.md."""

import subprocess
import sys
from pathlib import Path

import ssiam

ROOT = Path(__file__).parents[1]


def test_layers_only_import_lower_layers():
    lint = Path(sys.executable).parent / "lint-imports"
    done = subprocess.run([lint], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout
    assert "0 broken" in done.stdout


def test_importing_ssiam_loads_no_heavy_packages():
    code = (
        "import sys, ssiam\n"
        "heavy = {'torch', 'openvino', 'av', 'rich', 'ssiam.runtime.loading'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]"


def imported_by(code):
    """Names of the modules that a Python process has imported after running `code`."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def test_the_version_is_printed_without_importing_the_rest():
    found = imported_by("from ssiam.cli import main; main(['--version'])")
    assert {ssiam.__version__, "ssiam.cli.main"} < found
    assert not {"numpy", "cv2", "av", "openvino", "rich.markdown"} & found
    commands = {name for name in found if name.startswith("ssiam.cli.")}
    assert commands == {"ssiam.cli.main", "ssiam.cli.box_words"}


def test_names_and_subpackages_are_imported_when_they_are_used():
    found = {name for name in imported_by("import ssiam") if name.startswith("ssiam")}
    assert found == {"ssiam", "ssiam.opencv_wheels"}
    for name in ("video.open_source", "exchange.RerunLog", "datasets.Shake", "web.Session"):
        assert f"ssiam.{name.split('.')[0]}" in imported_by(f"import ssiam; ssiam.{name}")
    assert "ssiam.trackers" in imported_by("from ssiam import *; load_tracker")
    assert set(ssiam.__all__) <= set(dir(ssiam))
    assert all(hasattr(ssiam, name) for name in dir(ssiam))
    assert not hasattr(ssiam, "no_such_name")


def test_torch_is_an_optional_dependency():
    text = (ROOT / "pyproject.toml").read_text()
    assert "torch" not in text.split("[project.optional-dependencies]")[0].split("dependencies")[1]


def test_openvino_telemetry_is_off():
    code = (
        "import sys, ssiam.runtime.openvino, multiprocessing as m;"
        "print([n for n, v in sys.modules.items() if n.startswith('openvino_telemetry') and v],"
        " m.active_children())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[] []", done.stderr


def test_reading_results_imports_no_tracker():
    code = (
        "import sys, types; from pathlib import Path\n"
        "package = types.ModuleType('ssiam'); package.__path__ = [sys.argv[1]]\n"
        "sys.modules['ssiam'] = package  # without its __init__, which imports everything\n"
        "import ssiam.track, ssiam.video, ssiam.exchange, ssiam.datasets\n"
        "heavy = ('ssiam.trackers', 'ssiam.runtime', 'ssiam.networks', 'openvino')\n"
        "print(sorted(name for name in sys.modules if name.startswith(heavy)))\n"
    )
    source = str(ROOT / "src" / "ssiam")
    done = subprocess.run(
        [sys.executable, "-c", code, source], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "[]", done.stderr
