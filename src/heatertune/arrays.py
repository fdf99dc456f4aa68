"""Types of the NumPy arrays that numbers of the plant come in."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "Complex"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
