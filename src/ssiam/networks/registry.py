"""The networks by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, Literal, TypeAlias, get_args

from ssiam.errors import check_choice
from ssiam.networks.base import SiameseNetwork
from ssiam.networks.siamfc import SiamFC
from ssiam.networks.siammask import SiamMask, SiamMaskBase
from ssiam.networks.siamrpn import siamrpn_alex, siamrpn_mobilenet, siamrpn_resnet

__all__ = ["NETWORKS", "NetworkName", "build_network"]

NetworkName: TypeAlias = Literal[
    "siamfc",
    "siamrpn_alex_dwxcorr",
    "siamrpn_mobilev2_l234_dwxcorr",
    "siamrpn_r50_l234_dwxcorr",
    "siamrpn_r50_l234_dwxcorr_otb",
    "siammask_r50_l3",
    "siammask_base",
]

NETWORKS: Final[tuple[NetworkName, ...]] = get_args(NetworkName)

_BUILDERS: Final[dict[NetworkName, Callable[[], SiameseNetwork]]] = {
    "siamfc": SiamFC,
    "siamrpn_alex_dwxcorr": siamrpn_alex,
    "siamrpn_mobilev2_l234_dwxcorr": siamrpn_mobilenet,
    "siamrpn_r50_l234_dwxcorr": partial(siamrpn_resnet, weighted=True),
    "siamrpn_r50_l234_dwxcorr_otb": partial(siamrpn_resnet, weighted=False),
    "siammask_r50_l3": SiamMask,
    "siammask_base": SiamMaskBase,
}


def build_network(name: NetworkName) -> SiameseNetwork:
    """A network with random weights, in evaluation mode.

    Parameters
    ----------
    name : str
        One of `NETWORKS`: names of the authors' configurations (siamfc-pytorch, pysot), and
        `siammask_base` for SiamMask without refinement.

    Raises
    ------
    ArgumentError
        The name is unknown.
    """
    check_choice("network", name, NETWORKS)
    return _BUILDERS[name]().eval()
