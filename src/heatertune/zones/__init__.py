"""Heaters that belong together: one thermal network, tuned and proven as one, with the words of each zone.

`read_zones` reads a log, `fit_network` identifies the network, and `design_zones` tunes and proves all zones together.
"""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

__all__ = [
    "FittedNetwork", "JointProof", "ThermalNetwork", "ZoneLog", "design_zones", "export_zones", "fit_network",
    "network_by_hand", "prove_zones", "read_zones",
]

if TYPE_CHECKING:
    from heatertune.zones.identify import FittedNetwork, ZoneLog, fit_network, network_by_hand
    from heatertune.zones.joint_design import design_zones
    from heatertune.zones.joint_proof import JointProof, prove_zones
    from heatertune.zones.network import ThermalNetwork
    from heatertune.zones.zone_export import export_zones
    from heatertune.zones.zone_reader import read_zones

__getattr__, __dir__ = lazy_attributes(__name__, {
    "zones.identify": (
        "FittedNetwork", "ZoneLog", "fit_network", "network_by_hand"),
    "zones.joint_design": ("design_zones",),
    "zones.joint_proof": ("JointProof", "prove_zones"),
    "zones.network": ("ThermalNetwork",),
    "zones.zone_export": ("export_zones",),
    "zones.zone_reader": ("read_zones",),
})
