"""The analog modules of an S7-300/400, and the clock of a cyclic interrupt (CPU 31x manual)."""

from typing import Final

from heatertune.pid.values import Timer
from heatertune.plc.inputs import FOUR_TO_TWENTY, Range

__all__ = ["FULL_SCALE", "INPUT_S", "RANGES", "TICK_S", "TIMER"]

#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648

#: until an analog value is new: SM 331, eight channels at 50 Hz with wire-break check, 22 ms and 10 ms each (module
#: data A5E00105505); OB35 reads it and writes the output directly, by L PIW and T PQB, whatever the cycle of OB1 [s]
INPUT_S: Final = 8 * (0.022 + 0.010)

#: 4 mA is 0; thermocouples and resistance thermometers give 0.1 °C per digit, in the climatic range 0.01 °C
RANGES: Final = {
    FOUR_TO_TWENTY: Range(), "thermocouple": Range(high_degC=2764.8), "rtd": Range(high_degC=2764.8),
    "rtd-climatic": Range(high_degC=276.48),
}

#: OB35 is called every 1 ms to 1 min
TIMER: Final = Timer(shortest_s=0.001, longest_s=60.0, step_s=0.001)

#: OB35 as the exported program ticks where nobody asks for more: a half-wave of 50 Hz mains
TICK_S: Final = 0.01
