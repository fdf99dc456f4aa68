"""The tags of a PID_Compact, by which an S7-1200 or S7-1500 shows its instance over OPC UA.

The instance data block of a technology object is optimized: its members have names and no addresses. An address that
ends in `.*`, as `opc.tcp://192.168.0.10/ns=3;s="PID_Compact_1".*`, stands for all members of one instance. In such a
PLC each word is one node, and so is written alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.live.block_memory import CellAddress
from heatertune.live.siemens_blocks import COMPACT_PLACES

__all__ = ["INSTANCE", "NAMESPACE", "TAGGED", "TAGS", "instance_of"]

#: the controller whose tags these are
TAGGED: Final = "pid-compact"
#: name of the instance in a virtual PLC, and the namespace of the tags in an S7-1500
INSTANCE: Final = '"PID_Compact_1"'
NAMESPACE: Final = "http://www.siemens.com/simatic-s7-opcua"
_ALL: Final = ".*"
#: of a structure of the instance; other members are its own. The reading is the scaled one, whichever input it is from
_WITHIN: Final = {"Input": '"ScaledInput"', "OutputUpperLimit": '"Config"."OutputUpperLimit"',
                  "OutputLowerLimit": '"Config"."OutputLowerLimit"', "InvertControl": '"Config"."InvertControl"'} | {
    name: f'"Retain"."CtrlParams"."{name}"'
    for name in ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle")}
#: tag below the instance → where the same number stands in the block of `heatertune.live.siemens_blocks.CompactBlock`
TAGS: Final[Mapping[str, CellAddress]] = {
    _WITHIN.get(name, f'"{name}"'): place for name, place in COMPACT_PLACES.items()}


def instance_of(node: str) -> str:
    """Return the node of an instance whose tags an address stands for; empty where it is the node of a block."""
    return node.removesuffix(_ALL) if node.endswith(_ALL) else ""
