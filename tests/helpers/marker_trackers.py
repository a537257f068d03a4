"""Siamese trackers of the paper on stub networks that detect the marker; options as theirs."""

from helpers.stub_networks import (
    Stub,
    kernels,
    marker_features,
    marker_maps,
    marker_refinement,
    marker_responses,
)
from ssiam.trackers import siammask, siamrpn
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks
from ssiam.trackers.siammask import SiamMask, SiamMaskNetworks
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnNetworks


def siamfc_tracker(**options):
    networks = SiamFcNetworks(Stub(lambda t, crop: [crop]), marker_responses())
    return SiamFc(networks, **options)


def siamrpn_tracker(**options):
    networks = SiamRpnNetworks(Stub(kernels), marker_maps())
    return SiamRpn(networks, siamrpn.PARAMETERS["siamrpn_r50_l234_dwxcorr"], **options)


def siammask_tracker(**options):
    networks = SiamMaskNetworks(Stub(kernels), marker_features(), marker_refinement())
    return SiamMask(networks, siammask.PARAMETERS["siammask_r50_l3"], **options)
