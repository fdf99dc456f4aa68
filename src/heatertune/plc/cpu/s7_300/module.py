"""The analog modules of an S7-300/400."""

from typing import Final

__all__ = ["FULL_SCALE"]

#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648
