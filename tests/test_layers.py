"""The import rules of docs/explanation/architecture.md."""

import subprocess
import sys
from pathlib import Path

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
