"""Build hooks: the README for a package index, and the compiled kernel of the camera motion.

python hatch_build.py    # compile the kernel into the checkout, as an editable installation does
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

ROOT = Path(__file__).resolve().parent
KERNEL = Path("src/ssiam/motion/_kernel.c")
_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
# Every CPU of the platform must run it, and give the same results: no -march, no -ffast-math.
# The last two of the optimizer's flags let loops with roots and conditions become vectors.
_FLAGS = [
    *("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    *("-shared", "-fPIC", "-fvisibility=hidden"),
]
_IMAGE = re.compile(r"^!\[[^\]]*\]\((?!https?:)[^)]*\)\n+", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)([^)#]*)[^)]*\)")
_HERE = re.compile(r"(?<=pip install )('?)\.(?=\s|\[)")  # the checkout
_NOTE = "Paths in parentheses are files of the source distribution.\n"


class IndexReadme(MetadataHookInterface):
    """Sets the project's readme."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set `metadata["readme"]`."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": index_text(text)}


class KernelBuild(BuildHookInterface):
    """Compiles the kernel where there is a C compiler; without it, NumPy does its work."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Put the compiled kernel into the wheel, or beside its source for editable ones."""
        if self.target_name != "wheel":
            return
        source = Path(self.root) / KERNEL
        self._folder = Path(mkdtemp())
        folder = source.parent if version == "editable" else self._folder
        compiled, reason = compile_kernel(source, folder)
        if compiled is None:
            self.app.display_warning(f"camera motion will run in NumPy: {reason}")
            return
        build_data["pure_python"] = False
        platform = re.sub(r"[-.]", "_", sysconfig.get_platform())
        build_data["tag"] = f"py3-none-{platform}"
        if version != "editable":
            build_data["force_include"][str(compiled)] = f"ssiam/motion/{compiled.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the temporary folder."""
        if self.target_name == "wheel":
            shutil.rmtree(self._folder, ignore_errors=True)


def compile_kernel(source: Path, folder: Path) -> tuple[Path | None, str]:
    """Compile the kernel into a folder.

    Returns
    -------
    Path or None
        The shared library.
    str
        Why there is none.
    """
    named = shlex.split(os.environ.get("CC", ""))
    compilers = [named] if named else [["cc"], ["gcc"], ["clang"]]
    reason = "there is no C compiler (cc, gcc, clang or the one that CC names)"
    for compiler in compilers:
        if shutil.which(compiler[0]) is None:
            continue
        library = folder / f"{source.stem}{_SUFFIX}"
        partial = folder / f"{source.stem}.part{_SUFFIX}"
        command = [*compiler, *_FLAGS, str(source), "-o", str(partial), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode == 0:
            partial.replace(library)  # a process that has loaded the old one keeps it
            return library, ""
        reason = f"{compiler[0]} failed: {' '.join(done.stderr.split())[:200]}"
    return None, reason


def index_text(readme: str) -> str:
    """The README without relative images, with the paths of relative links as text.

    The package is installed by its name.
    """
    readme = _HERE.sub(r"\1ssiam", readme)
    title, _, rest = _IMAGE.sub("", readme).partition("\n")
    return f"{title}\n\n{_NOTE}{_LINK.sub(_as_text, rest)}"


def _as_text(link: re.Match[str]) -> str:
    text, path = link.groups()
    if not path:  # a heading of the same page
        return text
    return f"`{path}`" if text == path else f"{text} (`{path}`)"


if __name__ == "__main__":
    library, failure = compile_kernel(ROOT / KERNEL, (ROOT / KERNEL).parent)
    sys.exit(None if library else failure)
