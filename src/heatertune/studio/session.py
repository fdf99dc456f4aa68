"""What one user has in front of them: log, heater, settings, the loop, and up to four designs side by side.

Nothing here knows a browser or a thread. What takes long is a pure function of `heatertune.studio.loop`; its result
comes back with the ticket under which it was begun, and a stale one is kept for later but not shown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

from heatertune import chain
from heatertune.errors import ExportRefused, HeatertuneError, InputError
from heatertune.log.values import Log
from heatertune.model.values import FittedModel
from heatertune.proof import Proof
from heatertune.studio.loop import Gains, Look
from heatertune.studio.settings import Settings, settings_for
from heatertune.studio.sources import Source

__all__ = ["MOST_PINNED", "Pinned", "Session", "Ticket"]

MOST_PINNED: Final = 4
#: what a design depends on: number of the heater, settings, whether their optimum is known
Ticket = tuple[Any, ...]

_KEPT: Final = 200  # looks and proofs remembered, the oldest forgotten first


@dataclass(frozen=True, slots=True, kw_only=True)
class Pinned:
    """A design set aside for comparison.

    Attributes:
        name: one letter.
        look: the design and its loop.
        verdict: "PASS", "FAIL", "proving…" until it is known, "not proven" where that cannot be done.
    """

    name: str
    look: Look
    verdict: str


class Session:
    """State of one user.

    Attributes:
        log, fitted: None until there is one.
        coming: the log that is being fitted, or waits for it.
        settings: as moved.
        look: the loop of the settings that were last looked at; None before the first.
        error: why there is no design for the settings, one line; "" where there is one.
        file_error: why the last file was not taken, one line; "" where it was.
    """

    def __init__(self) -> None:
        self.log: Log | None = None
        self.fitted: FittedModel | None = None
        self.settings = Settings()
        self.look: Look | None = None
        self.error = self.file_error = ""
        self._heater = 0
        self._begun = 0
        self.coming: Log | None = None
        self._gains: dict[Ticket, Gains] = {}
        self._looks: dict[Ticket, Look] = {}
        self._proofs: dict[Ticket, Proof] = {}
        self._refused: dict[Ticket, str] = {}
        self._pins: list[tuple[str, Look, Ticket]] = []

    def load(self, source: Source) -> None:
        """Begin with what a path holds; a log without its heater waits for the fit."""
        self.settings = source.settings
        ticket = self.begin(source.log)
        if source.fitted is not None:
            self.fit_done(ticket, source.fitted)

    def begin(self, log: Log) -> int:
        """Take a new log; return the ticket of its fit. Heater and loop of the log before stay until it is done."""
        self._begun += 1
        self.coming = log
        self.file_error = ""
        return self._begun

    def fit_done(self, ticket: int, fitted: FittedModel) -> bool:
        """Take the heater of a log; return whether it is shown: not where another log came since."""
        if ticket != self._begun:
            return False
        self._heater = ticket
        self.log, self.fitted = self.coming, fitted
        self.settings = settings_for(fitted, self.settings)
        self.look, self.error, self._pins = None, "", []
        return True

    def fail(self, problem: HeatertuneError) -> None:
        """Show why there is no design for the settings."""
        self.error = str(problem)

    def refuse_file(self, problem: HeatertuneError) -> None:
        """Show why a file was not taken; log, heater and designs stay as they are."""
        self.file_error = str(problem)

    def change(self, **moved: Any) -> None:
        """Move settings; one that is refused changes nothing and shows its error."""
        try:
            self.settings = replace(self.settings, **moved)
        except HeatertuneError as problem:
            self.fail(problem)

    @property
    def ticket(self) -> Ticket:
        """What the design depends on: the heater, all settings, and whether its optimum is known."""
        return self._heater, self.settings, self._words_key() in self._gains

    def gains(self) -> Gains | None:
        """Return the optimum of the settings where it was searched, else None: quick gains will do."""
        return self._gains.get(self._words_key())

    def _words_key(self) -> Ticket:
        return self._heater, self.settings.target, self.settings.tuned, self.settings.scaling

    def known_look(self) -> bool:
        """Show the loop of the settings where it is remembered; return whether it is."""
        look = self._looks.pop(self.ticket, None)
        if look is not None:
            self._looks[self.ticket] = look  # the youngest again
            self.look, self.error = look, self._refused.get(self.ticket, "")
        return look is not None

    def look_done(self, ticket: Ticket, look: Look) -> bool:
        """Take a loop; return whether it is shown: not where the settings moved on."""
        _keep(self._looks, ticket, look)
        return ticket == self.ticket and self.known_look()

    def optimum_done(self, ticket: Ticket, gains: Gains) -> bool:
        """Take an optimum for the settings of a ticket; return whether these are still the ones in front."""
        _keep(self._gains, (ticket[0], ticket[1].target, ticket[1].tuned, ticket[1].scaling), gains)
        return ticket[:2] == self.ticket[:2]

    def proof_done(self, ticket: Ticket, proof: Proof) -> bool:
        """Take a full proof; return whether it is that of the design in front."""
        _keep(self._proofs, ticket, proof)
        return ticket == self.ticket

    def proof_refused(self, ticket: Ticket, problem: HeatertuneError) -> None:
        """Remember why a design cannot be proven, and show it where it is the one in front."""
        self._refused[ticket] = str(problem)
        if ticket == self.ticket:
            self.fail(problem)

    @property
    def front(self) -> Look | None:
        """The loop of the very settings in front; None while it is computed or where there is none."""
        return None if self.error else self._looks.get(self.ticket)

    @property
    def proof(self) -> Proof | None:
        """The full proof of the design in front; None until it is done."""
        return self._proofs.get(self.ticket)

    @property
    def verdict(self) -> str:
        """"PASS" or "FAIL" of the full proof, "proving…" until it is done, "no design" where there is none."""
        if self.error or self.look is None:
            return "no design"
        return self._verdict_of(self.ticket)

    def _verdict_of(self, ticket: Ticket) -> str:
        proof = self._proofs.get(ticket)
        return proof.verdict if proof is not None else "not proven" if ticket in self._refused else "proving…"

    @property
    def pinned(self) -> tuple[Pinned, ...]:
        """The designs set aside, the oldest first."""
        return tuple(Pinned(name=name, look=look, verdict=self._verdict_of(ticket))
                     for name, look, ticket in self._pins)

    def pin(self) -> None:
        """Set the design in front aside.

        Raises:
            InputError: there is none, it is there already, or there are four.
        """
        look = self.front
        if look is None:
            raise InputError("there is no design to keep")
        if self.ticket in [ticket for _, _, ticket in self._pins]:
            raise InputError("this design is kept already")
        if len(self._pins) == MOST_PINNED:
            raise InputError(f"{MOST_PINNED} designs are kept already: let one go first")
        name = next(letter for letter in "ABCD" if letter not in [taken for taken, _, _ in self._pins])
        self._pins.append((name, look, self.ticket))

    def unpin(self, name: str) -> None:
        """Let a design go."""
        self._pins = [pin for pin in self._pins if pin[0] != name]

    def unproven(self) -> list[tuple[Ticket, Look]]:
        """Return tickets and loops that wait for their full proof: the one in front, then those set aside."""
        front = {} if self.front is None else {self.ticket: self.front}
        waiting = front | {ticket: look for _, look, ticket in self._pins}
        done = self._proofs.keys() | self._refused.keys()
        return [(ticket, look) for ticket, look in waiting.items() if ticket not in done]

    def export(self, *, force: bool) -> dict[str, str | bytes]:
        """Return the export files of the design in front, name → content.

        Raises:
            ExportRefused: it is not proven, or FAIL and not forced.
        """
        look, proof = self.front, self.proof
        if look is None or proof is None:
            raise ExportRefused("the words are not proven yet")
        return chain.export(look.gains.words, proof, force=force)


def _keep(memory: dict[Ticket, Any], key: Ticket, value: Any) -> None:
    memory[key] = value
    if len(memory) > _KEPT:
        del memory[next(iter(memory))]
