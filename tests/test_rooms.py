"""The table of rooms of docs/explanation/architecture.md, held to the code."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_rooms_only_use_rooms_above_them():
    lint = Path(sys.executable).parent / "lint-imports"
    done = subprocess.run([lint], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout
    assert "0 broken" in done.stdout


def test_a_plain_import_is_light():
    code = (
        "import sys, ssiam; print(sorted({'torch', 'openvino', 'av', 'rich'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]"


def test_a_plain_install_has_no_torch():
    text = (ROOT / "pyproject.toml").read_text()
    assert "torch" not in text.split("[project.optional-dependencies]")[0].split("dependencies")[1]


def test_openvino_does_not_report_home():
    code = (
        "import sys, ssiam.runtime.openvino, multiprocessing as m;"
        "print([n for n, v in sys.modules.items() if n.startswith('openvino_telemetry') and v],"
        " m.active_children())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[] []", done.stderr
