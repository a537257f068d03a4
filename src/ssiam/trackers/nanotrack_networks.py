"""NanoTrack's networks: found, compiled, and checked to be those of the version asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from ssiam.errors import WeightsError
from ssiam.runtime import Network, Precision, RuntimeOptions, load_network
from ssiam.trackers.siamese import EXEMPLAR

NanoTrackName: TypeAlias = Literal["nanotrack_v1", "nanotrack_v2", "nanotrack_v3"]

SEARCH: Final = 255  # px, side of the search crop
_HEAD_CONVOLUTIONS: Final[dict[NanoTrackName, int]] = {  # v1 and v2 have the same shapes
    "nanotrack_v1": 18,
    "nanotrack_v2": 34,
    "nanotrack_v3": 46,
}


@dataclass(frozen=True)
class NanoTrackNetworks:
    """The three compiled networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` (1, 3, 127, 127) and `search` (1, 3, 255, 255) are one backbone; `head` takes the
    features of both and gives scores (1, 2, n, n) and distances (1, 4, n, n).
    """

    template: Network
    search: Network
    head: Network

    @classmethod
    def load(cls, name: NanoTrackName, weights: Path, running: RuntimeOptions) -> NanoTrackNetworks:
        """Networks from the folder that holds the two ONNX files, or from one of the two.

        With precision "int8" the backbone must be quantised, and the head may be. Raises
        `WeightsError` when they are missing, damaged, not quantised, or of another network.
        """
        backbone, head = _onnx_pair(weights)

        def compiled(
            path: Path, precision: Precision, shape: tuple[int, ...] | None = None
        ) -> Network:
            return load_network(
                path,
                shape,
                runtime=running.runtime,
                threads=running.threads,
                precision=precision,
                device=running.device,
            )

        networks = cls(
            compiled(backbone, running.precision, (1, 3, EXEMPLAR, EXEMPLAR)),
            compiled(backbone, running.precision, (1, 3, SEARCH, SEARCH)),
            compiled(head, "f32" if running.precision == "int8" else running.precision),
        )
        networks._check(name, weights)
        return networks

    def _check(self, name: NanoTrackName, weights: Path) -> None:
        features = [self.template.output_shapes, self.search.output_shapes]
        channels, side = (96, 15) if name == "nanotrack_v3" else (48, 16)
        wanted_features = [[(1, channels, 8, 8)], [(1, channels, 16, 16)]]
        wanted_maps = [(1, 2, side, side), (1, 4, side, side)]
        if (
            features != wanted_features
            or self.head.input_shapes != [shapes[0] for shapes in wanted_features]
            or self.head.output_shapes != wanted_maps
            or self.head.convolution_count != _HEAD_CONVOLUTIONS[name]
        ):
            raise WeightsError(
                f"{weights} holds weights of another network than {name}: "
                f"features {features[1][0]}, maps {self.head.output_shapes}, "
                f"{self.head.convolution_count} convolutions in the head; wanted "
                f"{wanted_features[1][0]}, {wanted_maps}, {_HEAD_CONVOLUTIONS[name]}"
            )


def _onnx_pair(weights: Path) -> tuple[Path, Path]:
    """The backbone's and the head's file in a folder, or beside one of them."""
    folder = weights if weights.is_dir() else weights.parent
    if not weights.exists():
        raise WeightsError(
            f"weights {weights} do not exist: give the folder of NanoTrack's two .onnx files"
        )
    if weights.is_file() and weights.suffix != ".onnx":
        raise WeightsError(f"weights {weights} are not an .onnx file: NanoTrack runs from ONNX")
    found = []
    for part in ("backbone", "head"):
        files = sorted(folder.glob(f"*{part}*.onnx"))
        if len(files) != 1:
            raise WeightsError(
                f"weights folder {folder} holds {len(files)} files named *{part}*.onnx, "
                "NanoTrack needs exactly one"
            )
        found.append(files[0])
    return found[0], found[1]
