"""What a virtual PLC serves of each controller: its block as bytes, and one scan on these bytes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any, Final, Protocol

from heatertune.live.layout import RegisterRange
from heatertune.live.memory import Signal
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.open_points import assumptions_from
from heatertune.plc.ramp import Number

__all__ = ["SERVED", "ServedBlock", "block_for"]


class ServedBlock(Protocol):
    """A controller's block in a PLC.

    Attributes:
        number: of the block; for an S7-200, whose V memory it is, 1.
        description: what it is, a few words.
        manual: whether clients can put the controller in manual.
        speaks: the protocols that reach it, the first without being asked for.
        registers: where Modbus finds its words; none: word w is register w.
        signals: where it shows temperature [°C], power [%] and setpoint [°C], by these names.
        words: word → where it stands; a word that stands elsewhere in the PLC, or in one bit, is none of them.
        bits: word of one bit → its byte, and which of that it is.
        mode: bytes that tell manual from automatic; none where nothing does.
        operators: words that are the operator's while the controller is in manual.
        undone_by: what in the PLC writes its own words over those of a client, a few words; nothing does where empty.
    """

    number: int
    description: str
    speaks: tuple[str, ...]
    registers: Sequence[RegisterRange]
    manual: bool
    signals: Mapping[str, Signal]
    words: Mapping[str, Signal]
    bits: Mapping[str, tuple[int, int]]
    mode: slice
    operators: tuple[str, ...]
    undone_by: str

    def image(self) -> bytes:
        """Return its bytes before the first scan."""

    def begin(self) -> Any:
        """Return the state before the first scan, which nobody else changes."""

    def scan(
        self, cells: bytearray, state: Any, setpoint: Number, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Run one scan on the block; what it writes goes into `cells`. Total for every bit pattern.

        Args:
            cells: the block, as the scan finds it.
            state: before the scan.
            setpoint: as the program asks for it; where it is another than at the scan before, it is written.
            reading: of the input module.

        Returns:
            State, power 0…100 %, output and flags, as `heatertune.plc.core.StepFunctions.step` gives them.
        """

    def restarted(self, state: Any) -> Any:
        """Return the state after a start-up."""

    def in_manual(self, cells: bytes | bytearray) -> bool:
        """Return whether the controller is in manual."""

    def into_automatic(self, cells: bytearray) -> None:
        """Put the controller back in automatic."""

    def put_in_manual(self, cells: bytes, power_pct: float) -> tuple[int, bytes]:
        """Return what a client writes to put the controller in manual with a power.

        Args:
            cells: the block as it stands.
            power_pct: 0…100 [%].

        Returns:
            First byte, and the bytes, of one request; the bytes that stood there before bring back what was.

        Raises:
            InputError: the controller has no manual mode that clients can reach.
        """

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word, as somebody at a programming unit does.

        Raises:
            InputError: no such word, or a value that the word cannot hold.
        """


#: target → module and class of its block; only what is served is loaded
SERVED: Final[Mapping[str, tuple[str, str]]] = {
    "s5-ob251": ("ob251", "Ob251Block"), "s7-200": ("s7_200", "PaperMemory"), "s7-200-pid": ("s7_200", "PidMemory"),
    "s7-300": ("s7_300", "PidTipBlock"), "fb41": ("fb41", "ContCBlock"), "pid-compact": ("pid_compact", "CompactBlock"),
    "pid-temp": ("pid_compact", "TempBlock"), "weg": ("weg", "WegBlock"), "iec-pid": ("iec_pid", "IecPidBlock"),
    **dict.fromkeys(
        ("pband", "omron-e5cc", "eurotherm-3200", "jumo-dicon", "omega-cn7800"), ("instrument", "InstrumentBlock")),
}


def block_for(controller: Controller, words: Words, switches: Mapping[str, str]) -> ServedBlock:
    """Return what a virtual PLC serves of a controller that runs words.

    Raises:
        KeyError: it is none of those that can be served.
        UnknownName: no such switch or setting.
    """
    module, name = SERVED[controller.name]
    made: Callable[[Controller, Words, Any], ServedBlock] = getattr(import_module(f"heatertune.live.{module}"), name)
    return made(controller, words, assumptions_from(controller.assumptions, switches))
