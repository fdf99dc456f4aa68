"""How often each word was written: memories that keep their words without supply wear out.

One file for each PLC, a line a write, in the user's state folder: `HEATERTUNE_STATE` moves it.
"""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from typing import Final

from heatertune.errors import InputError
from heatertune.live.client.address import Address
from heatertune.live.plc_state import state_folder
from heatertune.live.write.write_record import utc_now
from heatertune.writing import settle

__all__ = ["MOST_WRITES", "Budget"]

#: of one word, where the user says no other number; makers promise from 10,000 (EEPROM) to 100,000 writes on
MOST_WRITES: Final = 1000


class Budget:
    """The count of one block of one PLC.

    Attributes:
        path: of its file.
    """

    def __init__(self, address: Address, number: int, most: int = MOST_WRITES) -> None:
        """Take a block.

        Args:
            address: of the PLC.
            number: of the block.
            most: writes of one word.
        """
        where = f"{address.protocol} {address.host} {address.port} {address.way} {number} {address.block}"
        self.path = state_folder() / f"writes-{hashlib.sha256(where.encode()).hexdigest()[:16]}.log"
        self._where, self._most = where, most

    def counts(self) -> Counter[str]:
        """Return how often each word was written.

        Raises:
            InputError: the count cannot be read.
        """
        try:
            lines = self.path.read_text(encoding="utf-8", errors="replace").splitlines()
        except FileNotFoundError:
            return Counter()
        except OSError as problem:
            raise InputError(f"{self.path}: cannot be read: {problem.strerror}") from None
        return Counter(name for line in lines if not line.startswith("#") for name in line.split()[1:])

    def spent(self, names: tuple[str, ...]) -> str:
        """Return which word has been written often enough, a sentence; nothing where none has."""
        counts = self.counts()
        return next((f"{name} was written {counts[name]} times from here, and {self._most} is the most (--most-writes; "
                     f"the count is in {self.path})" for name in names if counts[name] >= self._most), "")

    def count(self, names: tuple[str, ...]) -> None:
        """Count a write of words, before it is made.

        Raises:
            InputError: the count cannot be kept.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            is_new = not self.path.exists()
            number = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
            try:
                head = f"# {self._where}\n" if is_new else ""
                os.write(number, f"{head}{utc_now()} {' '.join(names)}\n".encode())
                os.fsync(number)
            finally:
                os.close(number)
        except OSError as problem:
            raise InputError(f"{self.path}: cannot be written: {problem.strerror}") from None
        if is_new:
            settle(self.path.parent)
