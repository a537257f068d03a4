"""A module with trackers, written to a folder as somebody else would have it."""

import textwrap

SOURCE = '''
import ssiam


class Still:
    """Reports the first box."""

    def init(self, view, xywh):
        self.xywh = xywh

    def update(self, view):
        return ssiam.Track(self.xywh, score=0.5)


class Weighted(Still):
    """Takes weights and threads."""

    made = []

    def __init__(self, weights, threads=1, *, other=None):
        self.made.append((weights, threads, other))


class Optional(Still):
    def __init__(self, weights=None):
        self.weights = weights


class Broken(Still):
    def __init__(self):
        raise OSError("no such device")


class Outer:
    class Inner(Still):
        pass


NUMBER = 3
'''


def write_package(folder, name="others_trackers", source=SOURCE):
    """Write the module; its folder must be on sys.path."""
    (folder / f"{name}.py").write_text(textwrap.dedent(source))
    return name


def write_entry_point(folder, name, value):
    """Write the metadata of an installed package that declares a tracker."""
    info = folder / "others_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: others-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[ssiam.trackers]\n{name} = {value}\n")
