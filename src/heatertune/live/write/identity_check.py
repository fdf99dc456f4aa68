"""Whether the PLC is the one that the words were proven for: what can be looked at, and what somebody has to say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from heatertune.errors import InputError, OutOfRange
from heatertune.live.write.block_image import BlockImage
from heatertune.live.write.plc_block import BlockSnapshot, runs
from heatertune.live.write.proven_words import ProvenWords
from heatertune.plc.words import check_fields

__all__ = ["Check", "Declared", "checks", "interval_found", "refusal_reason"]

_NEAR: Final = 1e-9
_COUNT: Final = 1.5  # steps of the module: so near to its end a reading is that of a broken wire


@dataclass(frozen=True, slots=True, kw_only=True)
class Declared:
    """What somebody says of a PLC that its block does not hold.

    Attributes:
        called_every_s: interval at which the controller is called [s].
        range_degC: both ends of the sensor's range [°C].
        as_exported: whether the program around the words is the exported one.
        in_manual: whether the controller is in manual, and stays there.
    """

    called_every_s: float | None = None
    range_degC: tuple[float, float] | None = None
    as_exported: bool = False
    in_manual: bool = False


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that has to agree.

    Attributes:
        name: of it.
        ok: whether it does; None: nobody knows.
        told: what was found, a few words.
        option: that says it, where the PLC does not.
    """

    name: str
    ok: bool | None
    message: str
    option: str = ""

    def to_document(self) -> dict[str, Any]:
        """Return it as a document has it."""
        return {"name": self.name, "ok": self.ok, "told": self.message, "option": self.option or None}


def checks(proven: ProvenWords, standing: BlockImage, looks: tuple[BlockSnapshot, BlockSnapshot],
           said: Declared) -> list[Check]:
    """Return what was looked at of a PLC.

    Args:
        proven: what is to be written.
        standing: where.
        looks: at the PLC, two scans apart.
        said: what the block does not hold.
    """
    look = looks[1]
    return [
        _block(proven, standing, look), *_bits(proven, standing, look), _moves(looks),
        _interval(proven, standing, look, said), _range(proven, said), *_program(proven, said),
        _mode(standing, look, said), _reading(proven, standing, look), _setpoint(proven, standing, look),
    ]


def _block(proven: ProvenWords, standing: BlockImage, look: BlockSnapshot) -> Check:
    name = "block"
    try:
        check_fields(standing.controller.fields, standing.words(look.content, proven.words))
    except OutOfRange as problem:
        return Check(name, False, f"holds no words of {standing.controller.name}: {problem}")
    return Check(name, True, f"{standing.controller.name}, {standing.block.description}")


def _bits(proven: ProvenWords, standing: BlockImage, look: BlockSnapshot) -> Iterator[Check]:
    """Yield words of one bit that are not as proven: none is written, as its byte holds what is others', too."""
    found = standing.bits(look.content)
    if other := [f"{name} is {value}; {proven.words.values[name]:g} was proven" for name, value in found.items()
                 if value != proven.words.values[name]]:
        yield Check("bits", False, f"{', '.join(other)}: set them manually")


def _moves(looks: tuple[BlockSnapshot, BlockSnapshot]) -> Check:
    first, second = looks
    name = "CPU"
    if second.status is None or first.status is None:
        moved = first.content != second.content
        return Check(name, True if moved else None, "the block moves" if moved else
                     "nothing in the block moved in two scans: look whether it runs")
    if not runs(second):
        return Check(name, False, "is in STOP")
    moved = second.status.scans > first.status.scans
    return Check(name, moved, "runs, a simulator" if moved else "says that it runs, but no scan came")


def interval_found(standing: BlockImage, look: BlockSnapshot, said: Declared) -> tuple[float | None, str]:
    """Return the interval at which a PLC calls the controller [s], None where nobody tells it, and who does."""
    found, by = said.called_every_s, "as said"
    if look.status is not None:
        found, by = look.status.interval_s, "as the simulator says"
    if (held := standing.interval_s(look.content)) is not None:
        found, by = held, "by its words"
    return found, by


def _interval(proven: ProvenWords, standing: BlockImage, look: BlockSnapshot, said: Declared) -> Check:
    own = proven.words.sample_time_s
    found, by = interval_found(standing, look, said)
    if found is None:
        return Check("TA", None, f"{own:g} s was proven; the block does not hold it", f"--called-every {own:g}")
    same = abs(found - own) <= _NEAR * own
    return Check("TA", same, f"{found:g} s, {by}" + ("" if same else f"; {own:g} s was proven"))


def _range(proven: ProvenWords, said: Declared) -> Check:
    low, high = proven.words.scaling.sensor_degC
    if said.range_degC is None:
        return Check("sensor range", None, f"{low:g} to {high:g} °C was proven; no block holds it",
                     f"--range {low:g} {high:g}")
    same = all(abs(one - other) <= _NEAR for one, other in zip(said.range_degC, (low, high), strict=True))
    found = f"{said.range_degC[0]:g} to {said.range_degC[1]:g} °C, as said"
    return Check("sensor range", same, found if same else f"{found}; {low:g} to {high:g} °C was proven")


def _program(proven: ProvenWords, said: Declared) -> Iterator[Check]:
    words = proven.words
    around = {"setpoint ramp": words.ramp, "boost": words.boost, f"input {words.scaling.input}": words.scaling.input}
    if missing := [name for name, there in around.items() if there is not None]:
        ok = True if said.as_exported else None
        yield Check("program", ok, f"proven with {', '.join(missing)}" + (", there as said" if ok else ""),
                    "" if ok else "--as-exported")


def _mode(standing: BlockImage, look: BlockSnapshot, said: Declared) -> Check:
    manual = standing.in_manual(look.content)
    if manual == said.in_manual:
        return Check("mode", True, "manual, as said" if manual else "automatic")
    if manual:
        return Check("mode", False, "manual: put it in automatic, or say --in-manual")
    return Check("mode", False, "automatic, not manual as said")


def _reading(proven: ProvenWords, standing: BlockImage, look: BlockSnapshot) -> Check:
    seen, scale = standing.signal(look.content, "temperature"), proven.words.scaling
    step = _COUNT * scale.span_degC / standing.controller.counts
    low, high = scale.low_degC, scale.high_degC
    good = low <= seen <= high - step
    return Check("reading", good, f"{seen:.4g} °C" + ("" if good else
                 f"; expected {low:g} to {high - step:.4g} °C: is the sensor's wire broken?"))


def _setpoint(proven: ProvenWords, standing: BlockImage, look: BlockSnapshot) -> Check:
    asked, found = proven.view.scenario.setpoints_degC, standing.signal(look.content, "setpoint")
    around = proven.view.limits.tolerance_degC
    low, high = min(asked) - around, max(asked) + around
    if proven.words.ramp is not None:  # it is led there from the reading
        ambient = proven.view.scenario.ambient_degC or 0.0
        low, high = min(low, ambient), max(high, ambient)
    good = low <= found <= high
    return Check("setpoint", good, f"{found:.4g} °C" + ("" if good else
                 f"; proven from {min(asked):.4g} to {max(asked):.4g} °C"))


def refusal_reason(found: list[Check]) -> str:
    """Return why nothing is written, a sentence; nothing where all agrees.

    Raises:
        InputError: nobody has said what the PLC does not tell.
    """
    if wrong := [f"{check.name} {check.message}" for check in found if check.ok is False]:
        return "; ".join(wrong)
    if unsaid := [check.option for check in found if check.ok is None and check.option]:
        raise InputError(f"what the block does not hold has to be said, if it is so: {' '.join(unsaid)}")
    return ""
