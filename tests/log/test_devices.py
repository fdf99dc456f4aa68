"""Exports as devices write them are read as the heater that made them: instants, temperature and power of each row."""

import random
import re

import numpy as np
import pytest
from tests.bench import (
    field_exports,
    hostile_devices,
    hostile_exports,
    program_exports,
    service_exports,
    terminal_exports,
    tool_exports,
)
from tests.bench.messy import asked_for

from heatertune.errors import LogError
from heatertune.log import read_log

#: whose rows are not those of one heater, or no longer those of the table; `hostile_exports` judges what becomes of them
OTHERS = ("rows of two heaters in turns, not said", "°F until an update", "a reading that is late by a buffer of ten rows",
          "the last value while the bus is down", "words of a relay in French", "0.0 and -0.1 while the converter starts",
          "a recorder that prints every change of the power twice", "a simulation without names, exact and rising", "a rising loop without names, numbered rows",
          "blanks for readings in every second row, two devices")
TURNS = 4


def settings_of(words):
    """Return the settings of options as they are typed."""
    settings, words = {}, [*words]
    while words:
        name = words.pop(0).removeprefix("--").replace("-", "_")
        if name == "skip_empty":
            settings[name] = True
        elif name == "power_levels":
            settings[name] = (float(words.pop(0)), float(words.pop(0)))
        else:
            text = words.pop(0)
            number = name in ("log_interval", "power_full_scale", "temperature_scale", "skip_rows", "run")
            settings["sample_time_s" if name == "log_interval" else name] = (
                int(text) if name in ("skip_rows", "run") else float(text) if number else text)
    return settings


def read(export):
    """Read an export; what a message asks for is stated."""
    words = []
    for _ in range(TURNS):
        try:
            log = read_log(export.name, content=export.content, **settings_of(words))
            unknown = [flag for flag in (f"--{role}-unit" for role in log.taken.assumed) if flag in export.user]
            if not unknown:
                return log
            words += [unknown[0], export.user[unknown[0]]]
        except LogError as question:
            words += asked_for(str(question), export, words)
    raise AssertionError(words)


WRITERS = [*hostile_devices.WRITERS, *field_exports.WRITERS, *terminal_exports.WRITERS, *program_exports.WRITERS, *service_exports.WRITERS]


@pytest.mark.parametrize("export", [export for export in hostile_exports.exports(writers=WRITERS) if export.tool not in OTHERS],
                         ids=lambda export: export.tool)
def test_the_rows_are_the_heaters(export):
    run, log = tool_exports.steps(tool_exports.OVEN), read(export)
    seconds, degC, power = (np.array(each, dtype=float) for each in (run.seconds, run.degC, run.power))
    assert len(log.time_s) >= 0.35 * len(seconds)
    shift = min(seconds[:400], key=lambda begin: float(np.sum(np.abs(np.interp(log.time_s + begin, seconds, degC) - log.temperature_degC))))
    if re.search("asked for|counted", str(log.repairs)) is None:
        assert log.temperature_degC == pytest.approx(np.interp(log.time_s + shift, seconds, degC), abs=0.1), log.repairs
    if log.power_pct is not None and "--power-full-scale" in export.user and export.user["--power-full-scale"] == "0.5":
        assert np.max(log.power_pct) == pytest.approx(60.0)
    elif log.power_pct is not None:
        held = power[np.searchsorted(seconds, log.time_s + shift + 0.01, side="right") - 1]
        assert log.power_pct == pytest.approx(held, abs=0.06), log.repairs


@pytest.mark.parametrize("export", [export for export in hostile_exports.exports(writers=terminal_exports.WRITERS)
                                    if "without names" in export.tool and export.tool in OTHERS], ids=lambda export: export.tool)
def test_a_temperature_that_only_rises_is_not_taken_for_the_time(export):
    """The writers' heater: it begins at its room, and the clock counts whole seconds from 0."""
    log = read(export)
    assert log.temperature_degC[0] == pytest.approx(tool_exports.OVEN.room, abs=0.01)
    assert np.array_equal(log.time_s, np.arange(len(log.time_s)))
    assert np.all(np.diff(log.temperature_degC) >= 0.0)
    assert np.max(log.power_pct) > 50.0


@pytest.mark.parametrize("export", list(hostile_exports.exports(writers=program_exports.WRITERS + service_exports.WRITERS)), ids=lambda export: export.tool)
def test_no_damage_to_an_export_of_a_program_ends_in_a_fault(export):
    for number in range(4):
        content, lines = tool_exports.damage(export.content, random.Random(f"program-{number}")), 1
        try:
            read_log(export.name, content=content)
        except LogError as problem:
            lines = len(str(problem).splitlines())
        assert lines == 1
