"""Programs of the one-bit PLC: the heater that the document prints, and heatertune's two-level control of a heater.

The listings keep the document's words. Its address columns contain misprints (two signals at one address), so the
heater has addresses that work; see DIFFERENCES.md.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.one_bit.machine import Names

__all__ = ["HEATER", "HEATER_NAMES", "ON_OFF", "ON_OFF_NAMES"]


#: heater with fan sensor, below figure 9: R main switch (1 switches all off), A fan on, B heater on, C temperature
#: reached, D fan turns; F fan, H heater
HEATER: Final = """\
0. Test R
1. Jump(CFF=1) line15
2. Test H
3. Jump(CFF=0) line10
4. Test D
5. Reset(CFF=0) H
6. Reset(CFF=0) F
7. Test C
8. Reset(CFF=1) H
9. Reset(CFF=1) F
10. Test A
11. Set(CFF=1) F
12. Test B
13. Set(CFF=1) H
14. Jump line0
15. Reset H
16. Reset F
17. Jump line0
"""

#: R and B at the two free addresses below F
HEATER_NAMES: Final = Names(bits={"A": 0, "B": 1, "C": 2, "D": 3, "R": 4, "F": 5, "H": 6})
#: the project's own: heater off above SP + BAND, on below SP - BAND, as it was in between
ON_OFF: Final = """\
0. Load SP
1. Load BAND
2. Add
3. Load PV
4. Comp
5. Test AC1>AC2
6. Reset(CFF=1) OUT
7. Jump(CFF=1) line0
8. Load SP
9. Load BAND
10. Sub
11. Load PV
12. Comp
13. Test AC1<AC2
14. Set(CFF=1) OUT
15. Jump line0
"""

#: registers: setpoint, reading, half the hysteresis
ON_OFF_NAMES: Final = Names(bits={"OUT": 0, "AC1<AC2": 1, "AC1>AC2": 2}, registers={"SP": 0, "PV": 1, "BAND": 2})
