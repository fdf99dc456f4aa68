"""Several zones of a dropped log: their design, the same request as a command and in Python, and what the page shows.

All of it is made by `heatertune.zones`, as `heatertune design --zones` makes it. Pure functions, for any thread.
"""

from __future__ import annotations

import io
import math
import shlex
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from heatertune.codec import holds_zones
from heatertune.errors import HeatertuneError
from heatertune.model.statistics import Interval
from heatertune.options import options_of
from heatertune.processors import ProgressCallback
from heatertune.report.html import bullets, table, text_of
from heatertune.report.report_text import figure
from heatertune.settings import Conditions, ReadSettings
from heatertune.studio.charts import Options, line_chart, line_series
from heatertune.studio.loop_settings import StudioSettings
from heatertune.studio.proof_picture import downsample
from heatertune.studio.views import words_html
from heatertune.studio.wording import for_page
from heatertune.writing import read_bytes
from heatertune.zones.identify import FittedNetwork, ZoneLog, fit_network
from heatertune.zones.joint_design import design_zones
from heatertune.zones.joint_proof import JointProof, specification_for
from heatertune.zones.zone_export import demand_pass, demand_program, text_of_zone
from heatertune.zones.zone_reader import numbers_in, read_zones, zones_in
from heatertune.zones.zone_record import block_of_zone, design_files
from heatertune.zones.zones_folder import prove_again, read_zones_design

__all__ = [
    "DesignedZones", "ZonesRequest", "criteria_html", "design_of", "heaters_html", "parameters_html", "request_html",
    "suitable_range", "typed_numbers", "verdict_lines", "zones_charts", "zones_found", "zones_key", "zones_of",
]

_SENSOR_STEP: Final = 50.0  # sensors are sold in such ranges [°C]
_ABOVE: Final = 1.25  # sensor range over the highest temperature that is meant
_PIXELS: Final = 1500  # of a line
#: of the zones, each at least 4.5:1 on white
_COLORS: Final = ("#0072b2", "#a33c00", "#00634a", "#7a3e9d", "#b0006d", "#6a4a00", "#595959", "#1a1a1a")
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold: no date

@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesRequest:
    """What the design of zones is made for.

    Attributes:
        files: name and content of one log with all zones, or of one for each zone.
        zones: their names.
        settings: of the page; Ms and noise are not followed.
        reading: how each file is read.
        setpoints, rated_kw: a number for each zone, with commas; "": as logged, not stated [°C, kW].
        neighbours: which zones exchange heat; "": what the log shows.
        deviation_degC: by which a neighbour may leave its setpoint; None: the default [°C].
        peak_kw: most power of all heaters at once; None: no limit [kW].
        staggered: whether the PWM periods begin one after the other.
        spread_degC: by how much zones may be apart while all heat up together; None: no limit [°C].
    """

    files: tuple[tuple[str, bytes], ...] = field(repr=False)
    zones: tuple[str, ...]
    settings: StudioSettings
    reading: ReadSettings = field(default_factory=ReadSettings)
    setpoints: str = ""
    rated_kw: str = ""
    neighbours: str = ""
    deviation_degC: float | None = None
    peak_kw: float | None = None
    staggered: bool = False
    spread_degC: float | None = None

    @property
    def conditions(self) -> Conditions:
        """Conditions of the joint proof."""
        return replace(self.settings.conditions, noise_degC=Conditions().noise_degC)

    @property
    def command(self) -> str:
        """The same request at the terminal."""
        now, words = self.settings, ["heatertune", "design", self.files[0][0]]
        words += [word for name, _ in self.files[1:] for word in ("--zone-log", name)]
        words += ["--zones", ",".join(self.zones), "--target", now.target]
        words += ["--range", *(f"{end:g}" for end in now.scaling.sensor_degC)]
        stated: dict[str, object] = {
            "--input": now.input, "--zone-setpoints": self.setpoints.replace(" ", ""), "--peak-power": self.peak_kw,
            "--rated-power": self.rated_kw.replace(" ", ""), "--neighbours": self.neighbours,
            "--neighbour-deviation": self.deviation_degC, "--spread": self.spread_degC}
        words += [text for flag, value in stated.items() if value for text in (flag, f"{value}")]
        words += ["--stagger"] if self.staggered else []
        return shlex.join([*words, *_flags(self.conditions), *_flags(self.reading), *_flags(now.tune_settings, "ms")])

    @property
    def program(self) -> str:
        """The same request in Python."""
        names, numbers = [name for name, _ in self.files], typed_numbers("setpoints", self.setpoints)
        source, read = repr(names[0] if len(names) == 1 else names), _keywords(self.reading)
        own = [f"{name}={value!r}" for name, value in (
            ("rated_kw", typed_numbers("rated powers", self.rated_kw)), ("peak_kw", self.peak_kw),
            ("deviation_degC", self.deviation_degC), ("staggered", self.staggered),
            ("spread_degC", self.spread_degC)) if value]
        structure = f", structure={self.neighbours!r}" if self.neighbours else ""
        lines = [
            "from dataclasses import replace", "import heatertune as ht", "from heatertune.plc import Scaling",
            "from heatertune.settings import Conditions", "from heatertune.zones import design_zones, export_zones",
            "from heatertune.zones.joint_proof import specification_for", "",
            f"log = ht.read_zones({source}, {list(self.zones)!r}{read})", f"network = ht.fit(log{structure})",
            f"conditions = Conditions({_keywords(self.conditions).removeprefix(', ')})",
            f"setpoints = {numbers or self.settings.setpoint_degC!r}",
            f"specification = replace({', '.join(['specification_for(network, setpoints, conditions)', *own])})",
            f"proof = design_zones(network, {self.settings.target!r}, specification=specification, "
            "conditions=conditions,",
            f"    scaling={self.settings.scaling!r},",
            f"    structure={self.settings.structure!r}, sample_time_s={self.settings.sample_time_s!r})",
            "files = export_zones(proof)"]
        return "\n".join(lines)


def _changed(settings: Any, *but: str) -> dict[str, tuple[Any, Any]]:
    return {name: (option, value) for name, option in options_of(type(settings)).items()
            if name not in but and (value := getattr(settings, name)) != option.default}


def _flags(settings: Any, *but: str) -> Iterator[str]:
    """Yield the words of the command line for options that are not the default ones."""
    for option, value in _changed(settings, *but).values():
        pairs = [f"{name}={each}" for name, each in value.items()] if isinstance(value, dict) else value
        for each in pairs if isinstance(pairs, list | tuple) else [pairs]:
            yield from [option.flag] if each is True else [option.flag, str(each)]


def _keywords(settings: Any) -> str:
    return "".join(f", {name}={value!r}" for name, (_, value) in _changed(settings).items())


def typed_numbers(name: str, text: str) -> tuple[float, ...]:
    """Return numbers with commas between them, none of an empty text; arguments and errors as `numbers_in`."""
    return numbers_in(name, text) if text.strip() else ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignedZones:
    """A design of zones with its proof.

    Attributes:
        request: what it was made for; None: it is that of a folder.
        proof: of all zones together.
    """

    request: ZonesRequest | None
    proof: JointProof

    def files(self, *, force: bool) -> dict[str, str | bytes]:
        """Return the programs, the document and the record; errors as `export_zones`."""
        return design_files(self.proof, force=force)

    def zip(self, *, force: bool) -> bytes:
        """Return the files as one archive; raise ExportRefused where the verdict is not PASS and it is not forced."""
        demand_pass(self.proof, force=force)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in sorted(self.files(force=force).items()):
                archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)
        return packed.getvalue()


@contextmanager
def _stored(files: Sequence[tuple[str, bytes]]) -> Iterator[list[Path]]:
    """Store files while they are read: those of one heater have the name of another one's folder never."""
    with TemporaryDirectory() as folder:
        paths = []
        for number, (name, content) in enumerate(files):
            paths.append(Path(folder) / str(number) / Path(name).name)
            paths[-1].parent.mkdir()
            paths[-1].write_bytes(content)
        yield paths


def zones_found(files: Sequence[tuple[str, bytes]]) -> tuple[str, ...]:
    """Return the names of the zones in one file, or in one file for each; none of one heater."""
    zones = tuple(Path(name).stem for name, _ in files)
    try:
        with _stored(files) as paths:
            if len(files) == 1:
                return zones_in(paths[0])
            read_zones(paths, zones)
    except HeatertuneError:  # no zones; the sheet of the file shows what it holds
        return ()
    return zones


def zones_of(source: str) -> tuple[list[tuple[str, bytes]], tuple[str, ...], DesignedZones | None]:
    """Return what a path holds of zones: its file, their names, and the design of a folder.

    Raises:
        DocumentError, ExportRefused: a folder whose design is damaged, or does not pass.
    """
    if Path(source).is_dir():
        if not holds_zones(source):
            return [], (), None
        design = read_zones_design(source)
        return [], design.zones, DesignedZones(request=None, proof=prove_again(design))
    files = [(source, read_bytes(Path(source)))] if Path(source).is_file() else []
    return files, zones_found(files) if files else (), None


@lru_cache(2)
def _read(files: tuple[tuple[str, bytes], ...], zones: tuple[str, ...], reading: ReadSettings) -> ZoneLog:
    with _stored(files) as paths:
        return read_zones(paths, zones, reading)


@lru_cache(2)
def _fitted(
    files: tuple[tuple[str, bytes], ...], zones: tuple[str, ...], reading: ReadSettings, neighbours: str
) -> FittedNetwork:
    return fit_network(_read(files, zones, reading), structure=neighbours or None)


def suitable_range(files: tuple[tuple[str, bytes], ...], zones: tuple[str, ...]) -> dict[str, float]:
    """Return the ends of a sensor range that holds all temperatures of a log; errors as `read_zones`."""
    log = _read(files, zones, ReadSettings())
    values = np.concatenate([each.ravel() for each in (log.temperatures_degC, log.setpoints_degC) if each is not None])
    return {"low_degC": min(0.0, math.floor(float(values.min()) / _SENSOR_STEP) * _SENSOR_STEP),
            "high_degC": max(2.0, math.ceil(_ABOVE * float(values.max()) / _SENSOR_STEP)) * _SENSOR_STEP}


def design_of(request: ZonesRequest, progress: ProgressCallback) -> DesignedZones:
    """Fit, tune and prove all zones together.

    Raises:
        InputError: numbers that are none, or as `read_zones`, `fit_network` and `design_zones`.
        OutOfRange, UnknownName, NotRepresentable: likewise.
    """
    rated = typed_numbers("rated powers", request.rated_kw)
    setpoints = typed_numbers("setpoints", request.setpoints) or request.settings.setpoint_degC
    demand_program(request.settings.target, len(request.zones),
                   staggered=request.staggered or request.peak_kw is not None)
    progress("reading")
    _read(request.files, request.zones, request.reading)
    progress("fitting the network of all zones")
    fitted = _fitted(request.files, request.zones, request.reading, request.neighbours)
    progress("tuning and proving all zones together")
    spec = replace(specification_for(fitted, setpoints, request.conditions), deviation_degC=request.deviation_degC,
                   rated_kw=rated, peak_kw=request.peak_kw, staggered=request.staggered,
                   spread_degC=request.spread_degC)
    proof = design_zones(
        fitted, request.settings.target, scaling=request.settings.scaling, structure=request.settings.structure,
        sample_time_s=request.settings.sample_time_s, conditions=request.conditions, specification=spec)
    progress("")
    return DesignedZones(request=request, proof=proof)


#: quantity, name of its interval, field of the network, unit
_QUANTITIES: Final = (("gain", "gain_degC_per_pct", "gains_degC_per_pct", "°C/%"),
                      ("time constant", "time_constant_s", "time_constants_s", "s"),
                      ("second time constant", "second_time_constant_s", "second_time_constants_s", "s"),
                      ("dead time", "dead_time_s", "dead_times_s", "s"),
                      ("ambient", "ambient_degC", "ambients_degC", "°C"))


def heaters_html(fitted: FittedNetwork) -> str:
    """Return the heater of each zone and the couplings, with their intervals, as HTML."""
    network, zones, ends = fitted.network, fitted.network.zones, fitted.ci95
    rows = [[zone, name, figure(getattr(network, field)[number]), _interval(ends[f"{key} {zone}"]), unit]
            for number, zone in enumerate(zones) for name, key, field, unit in _QUANTITIES if f"{key} {zone}" in ends]
    couplings = [[f"{zones[zone]} from {zones[other]}", figure(float(network.exchange[zone, other])),
                  _interval(ends[f"exchange {name}"]), "shown" if shown else "open: the log does not show it"]
                 for (zone, other), (name, shown) in zip(fitted.layout.pairs, fitted.couplings.items(), strict=True)]
    heads = ("exchange: heat of zone", "times its own loss", "95 % interval", "log")
    return (table(("zone", "quantity", "value", "95 % interval", "unit"), rows, numeric=(2,))
            + (table(heads, couplings, numeric=(1,)) if couplings else "<p>No zone exchanges heat.</p>"))


def _interval(interval: Interval) -> str:
    return f"{figure(interval.low)} … {figure(interval.high)}"


def verdict_lines(proof: JointProof) -> tuple[str, str]:
    """Return the verdict as one line, and the reasons, assumptions and peak power as HTML."""
    first, *others = proof.brief().splitlines()
    return for_page(f"{first}."), bullets([*map(for_page, others)])


def criteria_html(proof: JointProof) -> str:
    """Return the criteria of the joint proof with their limits, as HTML."""
    rows = [[each.name, figure(each.value), f"≤ {figure(each.limit)}", each.where, "ok" if each.ok else "FAIL"]
            for each in proof.criteria]
    return table(("criterion", "worst", "limit", "zone and run", "kept"), rows, numeric=(1,))


def parameters_html(proof: JointProof) -> str:
    """Return the parameters of each zone as the programming tool shows them, each to be copied, as HTML."""
    parts = []
    for number, (zone, words, design) in enumerate(zip(
            proof.fitted.network.zones, proof.words, proof.design.designs, strict=True)):
        place, setpoint = block_of_zone(words.target, number), proof.specification.setpoints_degC[number]
        parts.append(
            f"<h3>Zone {text_of(zone)}: {text_of(words.target)}</h3><p>Setpoint {figure(setpoint)} °C; K "
            f"{figure(design.gain_pct_per_degC)} %/°C, TN {figure(design.integral_time_s)} s, TA "
            f"{figure(words.sample_time_s)} s; PWM period begins at {figure(proof.offsets_s[number])} s."
            f"{text_of(place)}</p>{text_of_zone(words.target, words_html(words, setpoint), number)}")
    return "".join(parts)


def request_html(request: ZonesRequest | None) -> str:
    """Return the same request at the terminal and in Python, as HTML; "" for the design of a folder."""
    if request is None:
        return ""
    return (f"<details><summary>The same at the terminal and in Python</summary><pre>{text_of(request.command)}</pre>"
            f"<pre>{text_of(request.program)}</pre></details>")


def zones_charts(proof: JointProof) -> tuple[Options, Options]:
    """Return temperatures with setpoints, and powers, of the first run: all zones heated up together."""
    trace, zones = proof.trace, proof.fitted.network.zones
    upper, lower = list[Options](), list[Options]()
    for number, zone in enumerate(zones):
        color = _COLORS[number % len(_COLORS)]
        for lines, values, name, kind in ((upper, trace.temperatures_degC, zone, None),
                                          (upper, trace.setpoints_degC, f"setpoint {zone}", "dotted"),
                                          (lower, trace.powers_pct, zone, None)):
            points = downsample(trace.time_s, values[:, number], _PIXELS)
            lines.append(line_series(
                name, trace.time_s[points], values[points, number], "realised", kind=kind, color=color))
    powers = line_chart("time [s]", "requested power [%]", lower)
    powers["yAxis"] |= {"min": 0, "max": 100}
    return line_chart("time [s]", "temperature [°C]", upper), powers


def zones_key(zones: Sequence[str]) -> list[tuple[str, str, str]]:
    """Return name, colour and dashes of each zone's lines."""
    return [(zone, _COLORS[number % len(_COLORS)], "") for number, zone in enumerate(zones)]
