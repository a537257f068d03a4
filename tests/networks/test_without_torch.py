"""The message of `import ssiam.networks` without PyTorch."""

import subprocess
import sys


def test_the_missing_extra_is_named():
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "import ssiam\n"
        "try:\n"
        "    import ssiam.networks\n"
        "except ssiam.MissingExtraError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "pip install 'ssiam[torch]'" in done.stdout, done.stderr
