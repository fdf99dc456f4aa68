"""The log that all other stages use, how its file was read, and the paper's tables with their known errata."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, LogError, OutOfRange
from heatertune.show import NotebookDisplay

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["ABSOLUTE_ZERO_DEGC", "AS_ROOM", "BUILT_IN", "EXPLICIT", "HOLD", "MIN_SAMPLES", "MOST_REPAIRED",
           "ON_CHANGE", "SAMPLES", "UNIT_OPTIONS", "BuiltIn", "Erratum", "Log", "LogSignal", "Option", "ReadSummary",
           "built_in"]


BUILT_IN: Final = ("table3", "table4")


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """A misprint of a table: line and column, printed and correct value, and the evidence."""

    line: int
    column: str
    printed: float
    corrected: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltIn:
    """One table.

    Attributes:
        name: "table3" or "table4".
        path: its CSV file.
        source: the paper, as one line.
        errata: its misprints.
        doubts: suspicious readings that are left as they are, one sentence each.
        same_heater: other tables of the same heater.
        rests_at_degC: where the record rests before it is disturbed [°C].
        output_limit_pct: largest output of the controller [%].
    """

    name: str
    path: Path
    source: str
    errata: tuple[Erratum, ...]
    doubts: tuple[str, ...]
    same_heater: tuple[str, ...]
    rests_at_degC: float
    output_limit_pct: float


def built_in(name: str) -> BuiltIn:
    """Return a built-in table.

    Raises:
        LogError: the installation lacks the data.
    """
    folder = _folder()
    described = tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))
    return BuiltIn(
        name=name, path=folder / f"{name}.csv",
        source=f"{described['source']['citation']}, {described['source']['table']}",
        errata=tuple(Erratum(**misprint) for misprint in described.get("errata", ())),
        doubts=tuple(f"t = {odd['time_s']} s, {odd['reading']} °C: {odd['why']}" for odd in described["suspicious"]),
        same_heater=tuple(described["same_heater"]), rests_at_degC=float(described["rests_at_degC"]),
        output_limit_pct=float(described["output_limit_pct"]))


def _folder() -> Path:
    package = Path(__file__).parents[1]
    for folder in (package / "data" / "paper_tables", package.parents[1] / "data" / "paper_tables"):
        if (folder / "table3.csv").is_file():
            return folder
    raise LogError("the built-in tables are missing; install heatertune again", file=package / "data" / "paper_tables")


#: role → option of `read_log` that states its unit
UNIT_OPTIONS: Final = {"time": "time_unit", "temperature": "temperature_unit", "power": "power_full_scale"}

Option = bool | float | str | tuple[float, float] | None

_ROLES: Final = ("time", "temperature", "power", "setpoint")
#: reported only where there is one
_NAMED: Final = ("disturbance", "cooling", "ambient")
#: share of the rows: more is reported on the verdict line
MOST_REPAIRED: Final = 0.01
_SHOWN: Final = 12  # unused columns named


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadSummary:
    """Summary of how a file was read.

    Attributes:
        file: its name.
        rows: readings in the log.
        interval_s: usual time between two of them [s].
        columns: role → (name of its column or tag, its notation: "°C", "0…255", "stamps"), absent if there is none.
        rows_read: rows of the file that are potential readings.
        left_out: number of them that were omitted.
        repeats: number of omitted rows that only repeated the previous one.
        repaired: rows in which a value was inserted.
        unused: columns or tags that were not used.
        moving_heaters: unused columns with the power of another heater, which changes in the log.
        reading: option of `read_log` → value that reproduces this reading without detection.
        assumed: role → option for its unit, for each unit that neither the file nor the user states.
        stated: roles whose unit the user gave as an option.
    """

    file: str
    rows: int
    interval_s: float
    columns: Mapping[str, tuple[str, str]]
    rows_read: int
    left_out: int = 0
    repeats: int = 0
    repaired: int = 0
    unused: tuple[str, ...] = ()
    moving_heaters: tuple[str, ...] = ()
    reading: Mapping[str, Option] = field(default_factory=dict)
    assumed: Mapping[str, str] = field(default_factory=dict)
    stated: frozenset[str] = frozenset()

    @property
    def begins_as_room(self) -> bool:
        """Whether the temperature is taken as °C because it begins like a room in °C."""
        return self.columns["temperature"][1].endswith(AS_ROOM)

    @property
    def repaired_share(self) -> float:
        """Share of the rows that were left out, repeats aside, or in which a value was put in."""
        return (self.left_out - self.repeats + self.repaired) / max(self.rows_read, 1)

    @property
    def line(self) -> str:
        """The whole summary in one line."""
        parts = [f"{self.rows} rows every {self.interval_s:.4g} s", ", ".join(map(self._column, self._roles))]
        for number, what in ((self.left_out, "left out"), (self.repaired, "repaired")):
            if number:
                parts.append(f"{number} row{'s' if number > 1 else ''} {what}")
        if self.unused:
            more = f" and {len(self.unused) - _SHOWN} more" if len(self.unused) > _SHOWN else ""
            parts.append(f"not used: {', '.join(map(repr, self.unused[:_SHOWN]))}{more}")
        return f"{self.file}: {'; '.join(parts)}"

    def unit_option(self, role: str) -> str:
        """Return the option that states the unit of a column as it was read: of time, temperature or power."""
        name = UNIT_OPTIONS[role]
        value = self.reading.get(name, "s")
        return f"--{name.replace('_', '-')} {f'{value:g}' if isinstance(value, float) else value}"

    @property
    def _roles(self) -> tuple[str, ...]:
        return (*_ROLES, *(role for role in _NAMED if role in self.columns))

    def _column(self, role: str) -> str:
        if role not in self.columns:
            return f"{role} = none"
        name, written = self.columns[role]
        return f"{role} = {name}" + (f" [{written}]" if written else "")

    def document(self) -> dict[str, Any]:
        """Return it as a JSON document holds it."""
        return {
            "line": self.line, "rows": self.rows, "interval_s": self.interval_s,
            "columns": {role: {"name": name, "written": written} for role, (name, written) in self.columns.items()},
            "rows_read": self.rows_read, "left_out": self.left_out, "repeats": self.repeats, "repaired": self.repaired,
            "repaired_share": self.repaired_share, "unused": list(self.unused), "reading": dict(self.reading),
            **({"moving_heaters": list(self.moving_heaters)} if self.moving_heaters else {})}


#: how the unit of a signal is known, and what is known between its instants
EXPLICIT: Final = "said by the file or the user"
#: of a temperature without a unit that begins like a room in °C: a store in °F or tenths above freezing may begin so
AS_ROOM: Final = "from a room's temperature"
HOLD: Final = "held until the next instant"
SAMPLES: Final = "sampled"
ON_CHANGE: Final = "constant until it is written again"


class LogSignal(NamedTuple):
    """A quantity that a log records at instants of its own, with the evidence for its unit.

    Attributes:
        values: at each instant, shape (n,) [s, °C, % of full power, a disturbance in its own unit].
        unit: as the option that states it has it: "min", "0.1degC", the reading at full power.
        shown: the same for people: "0.1 °C", "0…255", "stamps".
        evidence: what the unit is known by; "": by nothing, it is assumed.
        likely: the unit to propose where it is assumed.
        levels: readings without power and at full power, if the user states both.
        between: what is known between two instants.
        late_s: by how much it may have changed before the instant that shows it, in excess of the interval [s].
        time_s: its instants [s], strictly increasing, shape (n,); empty: those of the temperature.
    """

    values: Array
    unit: str = ""
    shown: str = ""
    evidence: str = EXPLICIT
    likely: str = ""
    levels: tuple[float, float] | None = None
    between: str = HOLD
    late_s: float = 0.0
    time_s: Array = np.empty(0)

    @property
    def written(self) -> str:
        """How the file writes it, and why that is believed if the file does not say it."""
        return self.shown if self.evidence == EXPLICIT else f"{self.shown}, {self.evidence or 'assumed'}"

    @property
    def full_scale(self) -> float:
        """The reading at full power."""
        return float(self.unit)

    def at(self, time_s: Array) -> Array:
        """Return the value that is held at each of some instants, before the first one the first, shape (m,)."""
        if self.time_s is time_s:
            return self.values
        return self.values[np.maximum(np.searchsorted(self.time_s, time_s, side="right") - 1, 0)]

    @property
    def changes(self) -> tuple[Array, Array]:
        """Instants from which it holds another value [s], the first included, and these values, shape (k,) each."""
        changed = np.concatenate([[True], np.diff(self.values) != 0.0])
        return self.time_s[changed], self.values[changed]

    def integral(self, time_s: Array, origin_s: float = 0.0) -> Array:
        """Return the integral of what is held from the first instant on, up to some since an origin, shape (m,)."""
        time, values = self._replace(time_s=self.time_s - origin_s).until(float(time_s[-1]))
        return np.asarray(np.interp(time_s, time, np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])))

    def until(self, end_s: float) -> tuple[Array, Array]:
        """Return its instants and values, the last one held to an end, shape (k,) each."""
        if end_s <= self.time_s[-1]:
            return self.time_s, self.values
        return np.append(self.time_s, end_s), np.append(self.values, self.values[-1])

    def window(self, start_s: float, end_s: float) -> LogSignal:
        """Return the values within start_s <= time <= end_s, and the one that is held at the start."""
        inside = (self.time_s >= start_s) & (self.time_s <= end_s)
        time = self.time_s[inside]
        if len(time) and time[0] == start_s:
            return self._replace(time_s=time, values=self.values[inside])
        initial_value = self.at(np.array([start_s]))
        return self._replace(time_s=np.append(start_s, time), values=np.append(initial_value, self.values[inside]))


ABSOLUTE_ZERO_DEGC = -273.15

#: Fewer readings than this cannot carry the five unknowns of a heater model.
MIN_SAMPLES = 20


#: attribute with a value for each reading → signal
ROWS: Final = {"temperature_degC": "temperature", "power_pct": "power", "setpoint_degC": "setpoint",
               "disturbance": "disturbance", "cooling_pct": "cooling", "ambient_degC": "ambient"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, init=False)
class Log(NotebookDisplay):
    """A temperature record: signals, each with instants of its own.

    Its rows are derived: `time_s` [s] and `temperature_degC` [°C] are the readings; `power_pct` [0…100 % of full
    power], `setpoint_degC` [°C], `disturbance` (a measured load in a unit of its own), `cooling_pct` (power of a cooler
    in addition to the heater [0…100 %]) and `ambient_degC` (temperature of the room [°C]) are what is held at these
    instants, all of shape (n,), or None. A log is constructed from signals, from rows under these names, or from both:
    a row then takes the place of the signal. All instants increase strictly.

    Attributes:
        name: short name shown to people.
        source: where the numbers come from (a file's name, a paper's table).
        signals: role → signal: "temperature", and as far as logged "power", "setpoint", "disturbance", "cooling" and
            "ambient".
        repairs: changes and assumptions of the reader, one sentence each.
        warnings: readings that look odd but were left as they are, one sentence each.
        same_heater: names of built-in logs taken on the same heater.
        taken: summary of how the file was read, None for a log that does not come from a file.
        rests_at_degC: steady-state temperature according to the source, None if not stated [°C].
        output_limit_pct: largest output of the controller according to the source, None if not stated [%].
        pwm_period_s: PWM period of the heater according to the source, 0 if not stated [s].
        cooling_gain: cooling power that `power_pct` holds below 0, at full cooling as a fraction of full heating.

    Raises:
        OutOfRange: shapes differ, fewer than 20 readings, times not increasing, values not finite,
            temperature constant or below absolute zero, power outside 0…100 %.
    """

    name: str
    source: str
    signals: Mapping[str, LogSignal]
    repairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    same_heater: tuple[str, ...] = field(default=())
    taken: ReadSummary | None = None
    rests_at_degC: float | None = None
    output_limit_pct: float | None = None
    pwm_period_s: float = 0.0
    cooling_gain: float = 0.0

    def __init__(  # noqa: PLR0913, the fields are those of a dataclass, and rows may take the place of signals
        self, *, name: str, source: str, signals: Mapping[str, LogSignal] | None = None, repairs: tuple[str, ...] = (),
        warnings: tuple[str, ...] = (), same_heater: tuple[str, ...] = (), taken: ReadSummary | None = None,
        rests_at_degC: float | None = None, output_limit_pct: float | None = None, pwm_period_s: float = 0.0,
        cooling_gain: float = 0.0,
        time_s: Array | None = None, **rows: Array | None,
    ) -> None:
        signal_map = dict(signals or {})
        time = signal_map["temperature"].time_s if time_s is None else time_s
        for column, values in rows.items():
            if column not in ROWS:
                raise TypeError(f"Log() got an unexpected keyword argument {column!r}")
            signal_map.pop(ROWS[column], None)
            if values is not None:
                signal = (signals or {}).get(ROWS[column], LogSignal(values))
                signal_map[ROWS[column]] = signal._replace(values=values, time_s=time)
        attributes = {"name": name, "source": source, "signals": _frozen_signals(signal_map, cooling_gain),
                      "repairs": repairs, "warnings": warnings, "same_heater": same_heater, "taken": taken,
                      "rests_at_degC": rests_at_degC, "output_limit_pct": output_limit_pct,
                      "pwm_period_s": pwm_period_s, "cooling_gain": cooling_gain}
        for attribute, value in attributes.items():
            object.__setattr__(self, attribute, value)

    @property
    def time_s(self) -> Array:
        """Instants of the readings, shape (n,) [s]."""
        return self.signals["temperature"].time_s

    @property
    def temperature_degC(self) -> Array:
        """Process variable, shape (n,) [°C]."""
        return self.signals["temperature"].values

    @property
    def power_pct(self) -> Array | None:
        """Power of the heater at the readings, shape (n,) [%]; None: not logged."""
        return self._row("power")

    @property
    def setpoint_degC(self) -> Array | None:
        """Setpoint at the readings, shape (n,) [°C]; None: not logged."""
        return self._row("setpoint")

    @property
    def disturbance(self) -> Array | None:
        """Measured load at the readings, in a unit of its own, shape (n,); None: not logged."""
        return self._row("disturbance")

    @property
    def cooling_pct(self) -> Array | None:
        """Power of a cooler at the readings, shape (n,) [% of its full power]; None: not logged."""
        return self._row("cooling")

    @property
    def ambient_degC(self) -> Array | None:
        """Temperature of the room at the readings, shape (n,) [°C]; None: not logged."""
        return self._row("ambient")

    def _row(self, role: str) -> Array | None:
        signal = self.signals.get(role)
        return None if signal is None else signal.at(self.time_s)

    def __repr__(self) -> str:
        """Return name, size and columns in one line; `summary()` has the rest."""
        columns = ("power_pct", "setpoint_degC", "disturbance", "cooling_pct", "ambient_degC")
        logged = ", ".join(["temperature", *(each for each in columns if getattr(self, each) is not None)])
        return f"<Log {self.name}: {len(self.time_s)} rows in {float(np.ptp(self.time_s)):g} s, {logged}>"

    @classmethod
    def from_frame(cls, frame: DataFrame, *, time: str | None = None, temperature: str = "temperature_degC",
                   power: str = "power_pct", setpoint: str = "setpoint_degC", name: str = "frame") -> Log:
        """Convert a pandas table to a log; `read_log` accepts one too, and detects units and columns.

        Args:
            frame: a row for each reading.
            time: name of the column of seconds or of time stamps; by default "time_s", else the table's index.
            temperature: name of the column of the temperature [°C].
            power: column of the power [0…100 %], ignored if it does not exist; the same for the setpoint [°C].
            setpoint: see power.
            name: shown to people.

        Raises:
            InputError: a column named here that does not exist.
            OutOfRange: as the class says.
        """
        names = (time, temperature, *(header for header, usual in ((power, "power_pct"), (setpoint, "setpoint_degC"))
                                      if header != usual))
        missing = [header for header in names if header is not None and header not in frame]
        if missing:
            raise InputError(f"{name}: no column {missing[0]!r}; there are {', '.join(map(str, frame.columns))}")
        when = frame[time or "time_s"] if time or "time_s" in frame else frame.index
        return cls(name=name, source="a table of pandas", time_s=_seconds(np.asarray(when)),
                   temperature_degC=frame[temperature].to_numpy(),
                   **{role: frame[column].to_numpy() for role, column in
                      (("power_pct", power), ("setpoint_degC", setpoint)) if column in frame})

    def to_frame(self) -> DataFrame:
        """Return the log as a table of pandas: time_s, temperature_degC, and power_pct and setpoint_degC where logged.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            from pandas import DataFrame
        except ImportError as problem:
            raise InputError("a table needs pandas: pip install 'heatertune[notebook]'") from problem
        columns = ("time_s", "temperature_degC", "power_pct", "setpoint_degC")
        return DataFrame({name: column for name in columns if (column := getattr(self, name)) is not None})

    def window(self, start_s: float, end_s: float) -> Log:
        """Return the readings with start_s <= time <= end_s.

        Raises:
            OutOfRange: fewer than 20 are left.
        """
        rows = (self.time_s >= start_s) & (self.time_s <= end_s)
        if (left := int(np.count_nonzero(rows))) < MIN_SAMPLES:
            raise OutOfRange(f"number of readings from {start_s:g} to {end_s:g} s", left, (
                f">= {MIN_SAMPLES}; {self.name} goes from {self.time_s[0]:g} to {self.time_s[-1]:g} s"))
        return self.part(rows)

    def part(self, rows: npt.NDArray[np.bool_]) -> Log:
        """Return those of the readings that a mask, shape (n,), takes; other signals from the first to the last.

        Raises:
            OutOfRange: fewer than 20 are left.
        """
        time = self.time_s[rows]
        if len(time) < MIN_SAMPLES:
            raise OutOfRange("number of samples", len(time), f">= {MIN_SAMPLES}")
        signals = {
            role: signal._replace(time_s=time, values=signal.values[rows]) if signal.time_s is self.time_s
            else signal.window(float(time[0]), float(time[-1])) for role, signal in self.signals.items()}
        if "cooling" in signals and not np.any(signals["cooling"].values):
            del signals["cooling"]
        return replace(self, signals=signals)

    def on_one_clock(self) -> Log:
        """Return the log with a row at each instant of any signal, the temperature interpolated there.

        It is the same log where no signal has instants of its own.
        """
        others = [signal.time_s for signal in self.signals.values() if signal.time_s is not self.time_s]
        if not others:
            return self
        time = np.unique(np.concatenate([self.time_s, *others]))
        time = time[(time >= self.time_s[0]) & (time <= self.time_s[-1])]
        rows: dict[str, Array] = {column: self.signals[role].at(time) for column, role in ROWS.items()
                                  if role in self.signals}
        rows["temperature_degC"] = np.interp(time, self.time_s, self.temperature_degC)
        return self.with_rows(time_s=time, **rows)

    def with_rows(self, **rows: Array | None) -> Log:
        """Return the log with other values at its readings, or at other instants; None takes a signal away.

        Args:
            rows: `time_s` and the names of rows; shape (n,) each.
        """
        values = {each.name: getattr(self, each.name) for each in fields(self)} | rows
        return Log(**values)

    def demand_heater_alone(self, purpose: str) -> None:
        """Refuse a log with a cooler's power for what knows the heater's alone.

        Raises:
            InputError: it has a cooler's power; `purpose` says what cannot use it, and another way.
        """
        if self.cooling_pct is not None:
            raise InputError(f"{self.name}: the log holds the power of a cooler, {purpose}")

    def with_net_power(self, cooling_gain: float) -> Log:
        """Return the log with one power, that of the cooler below 0, as a heater of one gain has it.

        Args:
            cooling_gain: effect of full cooling as a fraction of that of full heating.
        """
        power, cooling = self.signals["power"], self.signals["cooling"]
        time = np.union1d(power.time_s, cooling.time_s)
        net = power._replace(time_s=time, values=power.at(time) - cooling_gain * cooling.at(time))
        signals = {role: signal for role, signal in self.signals.items() if role != "cooling"} | {"power": net}
        return replace(self, signals=signals, cooling_gain=max(cooling_gain, 0.0))


#: row → least and most value
_BOUNDS: Final = {"temperature_degC": (ABSOLUTE_ZERO_DEGC, np.inf), "power_pct": (0.0, 100.0),
                  "cooling_pct": (0.0, 100.0)}


def _frozen_signals(signals: Mapping[str, LogSignal], cooling_gain: float) -> dict[str, LogSignal]:
    """Return signals whose arrays are checked and cannot be written; equal instants are one array."""
    temperature = signals["temperature"]
    if len(temperature.time_s) < MIN_SAMPLES:
        raise OutOfRange("number of samples", len(temperature.time_s), f">= {MIN_SAMPLES}")
    clocks: dict[int, Array] = {}
    frozen = {role: _frozen_signal(column, signals[role], temperature.time_s, clocks, cooling_gain)
              for column, role in ROWS.items() if role in signals}
    readings = frozen["temperature"].values
    if np.ptp(readings) == 0.0:
        raise OutOfRange("temperature_degC", float(readings[0]), "varying, not constant")
    if "cooling" in frozen and "power" not in frozen:
        raise OutOfRange("cooling_pct", float(frozen["cooling"].values[0]), "logged together with the heater's power")
    return frozen


def _frozen_signal(column: str, signal: LogSignal, readings_s: Array, clocks: dict[int, Array],
                   cooling_gain: float) -> LogSignal:
    time = signal.time_s if len(signal.time_s) and not np.array_equal(signal.time_s, readings_s) else readings_s
    if id(time) not in clocks:
        clocks[id(time)] = _frozen("time_s", time, len(time))
        if not np.all(np.diff(time) > 0):
            raise OutOfRange("time_s", float(time[0]), "strictly increasing")
    values = _frozen(column, signal.values, len(time))
    least, most = _BOUNDS.get(column, (-np.inf, np.inf))
    _demand_bounds(column, values, least - 100.0 * cooling_gain if column == "power_pct" else least, most)
    return signal._replace(time_s=clocks[id(time)], values=values)


def _demand_bounds(name: str, column: Array, least: float, most: float) -> None:
    outside = column[(column < least) | (column > most)]
    if len(outside):
        raise OutOfRange(name, float(outside[0]), f">= {least:g} and <= {most:g}")


def _seconds(when: npt.NDArray[Any]) -> Array:
    """Return time stamps as seconds since the first, numbers as they are."""
    if when.dtype.kind == "M":
        return np.asarray((when - when[0]) / np.timedelta64(1, "s"))
    return np.asarray(when, dtype=np.float64)


def _frozen(name: str, column: Array, n: int) -> Array:
    array = np.array(column, dtype=np.float64)
    if array.shape != (n,):
        raise OutOfRange(name, array.shape, f"of shape ({n},)")
    if not np.all(np.isfinite(array)):
        raise OutOfRange(name, float(array[~np.isfinite(array)][0]), "finite")
    array.setflags(write=False)
    return array
