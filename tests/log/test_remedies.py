"""Each option that a refusal or a note of the readers names is typed as it stands, and the reading goes on.

The register: the functions of `heatertune.log` whose texts name an option are those of the cases here, with the same options.
"""

import ast
import importlib.util
import json
import re
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from tests.bench.messy import command
from tests.bench.tool_exports import START, _xlsx

import heatertune.log
from heatertune.errors import LogError

FOLDER = Path(heatertune.log.__file__).parent
OPTION = re.compile(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*")


class Case(NamedTuple):
    """A file, what the user stated, and the ways on.

    Attributes:
        site: the function whose text names the options.
        content: of the file.
        ways: words to type in turn, each alone; a leading "-" takes an option of `stated` back.
        stated: words that were typed before.
        only_shown: options that the text names because they were typed, or for which it says that they mean nothing.
        other: content of a second file, stated as `--power-log`.
        notes: whether the reading goes on, and only notes name the options.
        tool: command that is typed.
        name: of the file.
    """

    site: str
    content: str | bytes
    ways: tuple[str, ...]
    stated: str = ""
    only_shown: tuple[str, ...] = ()
    other: str | None = None
    notes: bool = False
    tool: str = "read"
    name: str = "log.csv"


ROWS = 80
S = [2 * k for k in range(ROWS)]
T = [f"{20 + (0 if k < 20 else 0.4 * (k - 20)):.1f}" for k in range(ROWS)]
P = [0 if k < 15 else 60 if k < 60 else 20 for k in range(ROWS)]
HEAD = "time [s],Temp [°C],Heater [%]"


def table(head, *columns, sep=","):
    """Return a table with a header, or without one."""
    return "\n".join(([head] if head else []) + [sep.join(map(str, row)) for row in zip(*columns, strict=True)]) + "\n"


def clock(second, pattern="%Y-%m-%d %H:%M:%S"):
    return START.fromtimestamp(START.timestamp() + second).strftime(pattern)


def klippy(*names):
    """Return a klippy.log of heaters that all move."""
    heaters = [" ".join(f"{name}: target=50 temp={float(t) + 5 * i:.1f} pwm={p / 100:.3f}" for i, name in enumerate(names)) for t, p in zip(T, P, strict=True)]
    return "Starting Klippy...\n" + "".join(f"Stats {900.0 + s:.1f}: gcodein=0 {heater} print_time={s:.3f}\n" for s, heater in zip(S, heaters, strict=True))


def serial(bed=T):
    """Return reports of a printer with two heaters."""
    return "".join(f"Recv: ok T:{t} /50.0 B:{b} /50.0 @:{round(1.27 * p)} B@:{round(1.27 * p)}\n" for t, b, p in zip(T, bed, P, strict=True))


def wide(power="Heater [%]", values=P, **options):
    return table(f"time [s],Temp [°C],{power}", S, T, values)


def long(tags, time="Time", value="Value"):
    """Return a table with a row for each tag; tags: name → its values."""
    rows = [(clock(s), name, values[k]) for k, s in enumerate(S) for name, values in tags.items()]
    return table(f"{time},Tag,{value}", *zip(*rows, strict=True))


BACK = table("Time,Temp [°C],Heater [%]", [clock(s if s < 80 else s - 37) for s in S], T, P)
FORTH = table("Time,Temp [°C],Heater [%]", [clock(s if s < 80 else s + 3600) for s in S], T, P)
TWICE = [s for s in S for _ in (0, 1)]
BOTH = [t for k, t in enumerate(T) for t in (t, f"{31 + 0.1 * (k % 5):.1f}")]
NEAR = [near for t in T for near in (t, f"{float(t) + 0.1:.1f}")]
COARSE = [8 * (k // 4) if k < ROWS // 2 else 80 + 4 * (k // 2) for k in range(ROWS)]
BLANKS = ["" if k % 4 == 3 else t for k, t in enumerate(T)]
LOST = ["Err" if k % 13 == 3 else "-127.0" if k % 20 == 5 else t for k, t in enumerate(T)]
SETPOINT = [20.0 if k < 25 else 55.0 for k in range(ROWS)]
WANDERS = [f"{5 + 3 * (k * 7919 % 101) / 101:.2f}" for k in range(ROWS)]
BOTH_ON = [5 if 30 < k < 40 else 0 for k in range(ROWS)]

CASES = (
    Case("cells._without_partial_rows", table(HEAD, S[:15], T[:15], P[:15]) + table("", S, T, P, [40] * ROWS), ("--skip-rows 16",)),
    Case("cells._without_partial_rows", "".join(
        f"{line}\n" if k % 6 or not k else f"{line.rpartition(',')[0]}\n" for k, line in enumerate(wide().splitlines())), ("--skip-empty",)),
    Case("cells._with_closed_quotes", 'a "title\nof "three\nlines "\n' + wide(), ("--skip-rows 3",)),
    Case("cleaning._put_back_repeats", BACK, ("--log-interval 2",)),
    Case("cleaning._demand_one_heater", table("time [s],Temp [°C],Heater [%],side", TWICE, NEAR, [p for p in P for _ in (0, 1)], ["a", "b"] * ROWS),
         ("--tag a --tag-column side",)),
    Case("cleaning._demand_one_heater", table(HEAD, COARSE, T, P), ("--log-interval 2",)),
    Case("partial_rows.demand_one_heater_by_name",
         table("time [s],Temp [°C],Heater [%],Channel", range(2 * ROWS), BOTH, [p for p in P for _ in (0, 1)], [1, 2] * ROWS),
         ("--tag 1 --tag-column Channel", "--tag-column none")),
    Case("partial_rows.demand_one_heater_by_turns", table(HEAD, range(2 * ROWS), BOTH, [p for p in P for _ in (0, 1)]),
         ('--tag "1 of 2"', "--tag-column none")),
    Case("columns._from_numbers", table(HEAD, [s if k > 9 else "" for k, s in enumerate(S)], T, P), ("--log-interval 2",)),
    Case("quantities.demand_one_unit", table("time [min],Temp [°C],Heater [%]", [f"{s} s" for s in S], T, P), ("--time-unit s",)),
    Case("quantities.demand_one_unit", table("time [s],Temp [°C],Heater [0..255]", S, T, [f"{p} %" for p in P]), ("--power-full-scale 100",)),
    Case("quantities.demand_one_unit", table(HEAD, S, [f"{1.8 * float(t) + 32:.1f} °F" for t in T], P), ("--temperature-unit degF",)),
    Case("cleaning.one_run", wide() + wide().partition("\n")[2], ("--run 2",), notes=True),
    Case("cleaning.no_readings", table(HEAD, S, LOST, P), ("--skip-empty",)),
    Case("cleaning._other_column", table("time [s],Temperature [°C],Value [°C],Heater [%]", S, SETPOINT, [f"{float(t) - 0.3 * (k % 2):.1f}" for k, t in enumerate(T)], P), ('--temperature-column "Value [°C]"',)),
    Case("cleaning.tell_gaps", FORTH, ("--log-interval 2",), notes=True),
    Case("columns.find_columns", table("time [s],foo,Heater [%]", S, T, P), ("--temperature-column foo", "--temperature-column 2")),
    Case("columns.find_columns", table("time [s],foo,bar", S, T, P), ("--temperature-column 2 --power-column 3", "--temperature-column foo --power-column none")),
    Case("columns._growing_clock", table("", range(ROWS), [f"{20 + 0.01 * k ** 2:.2f}" for k in range(ROWS)], WANDERS),
         ("--time-column 1", "--time-column 2")),
    Case("columns.with_dates", table("time [s],Temp [°C],Heater [%],Day,Clock", S, T, P, ["2026-03-14"] * ROWS, [clock(s, "%H:%M:%S") for s in S]),
         ("--time-column Clock",), stated="--date-column Day"),
    Case("columns.with_dates", table("Clock,Temp [°C],Heater [%],D", [clock(s, "%H:%M:%S") for s in S], T, P, ["2026-03-14"] * ROWS),
         ("-date-column --date-column D", "-date-column --date-column 4"), stated="--date-column Date"),
    Case("columns.seconds", table("x,Temp [°C],Heater [%]", S, T, P), ("--log-interval 2", "--time-column x --time-unit s")),
    Case("columns._two_numbers", table("Time,Temp [°C],Heater [%]", [f"{s // 60:02d}:{s % 60:02d}" for s in S], T, P), ("--time-unit mm:ss", "--time-unit hh:mm")),
    Case("columns._from_numbers", table("time [ticks],Temp [°C],Heater [%]", S, T, P), tuple(
        f"--time-unit {unit}" for unit in ("s", "ms", "us", "ns", "min", "h", "d"))),
    Case("columns._from_numbers", table("time,Temp [°C],Heater [%]", S, T, P), ("-time-unit --time-unit s",), stated="--time-unit mm:ss"),
    Case("columns._from_numbers", table("time,Temp [°C],Heater [%]", S, T, P), ("--time-unit min",), notes=True),
    Case("columns._from_stamps", table("Time,Temp [°C],Heater [%]", [f"{1 + k % 12:02d}/{1 + k // 12:02d}/2026 10:00" for k in range(ROWS)], T, P), ("--log-interval 2",)),
    Case("columns.demand_one_form", table("time [s],Temp [°C],Heater [%]", S, [f"1.{500 + 3 * k:03d}" for k in range(ROWS)], P),
         ('--decimal-comma "Temp [°C]"', "--decimal-comma none")),
    Case("formats/device_logs._longest", json.dumps({zone: [{"time_s": s, "temp_C": float(t), "power_pct": p} for s, t, p in zip(S, T, P, strict=True)]
                                                     for zone in ("zone1", "zone2")}), ("--tag zone1", "--tag zone2"), name="zones.json"),
    Case("formats/printer_logs._klippy", klippy("extruder", "heater_bed"), ("--tag heater_bed",), notes=True, name="klippy.log"),
    Case("formats/printer_logs._heater_to_read", klippy("heater_bed", "heater_generic_a"), ("--tag heater_bed", "--tag heater_generic_a"), name="klippy.log"),
    Case("formats/printer_logs._heater_to_read", klippy("extruder", "heater_bed"), ("-tag --tag extruder", "-tag --tag heater_bed"), stated="--tag tool",
         name="klippy.log"),
    Case("formats/printer_logs._serial", serial(), ("--tag T --log-interval 2", "--tag B --log-interval 2"), name="serial.log"),
    Case("formats/printer_logs._serial", serial([22.0 + 0.1 * (k % 5) for k in range(ROWS)]), ("--tag B",), stated="--log-interval 2", notes=True, name="serial.log"),
    Case("partial_rows.good_rows", table(f"{HEAD},Quality", S, T, P, [7 + k % 2 for k in range(ROWS)]), ("--quality-column none",)),
    Case("power_range._refuse_readings", table("time [s],Temp [°C],xyz", S, T, WANDERS), ("--power-column xyz", "-power-full-scale"),
         stated="--power-full-scale 255"),
    Case("power_range._refuse_readings", table("time [s],Temp [°C],xyz", S, T, WANDERS), ("--power-column xyz", "-power-levels"), stated="--power-levels 4 20"),
    Case("power_range.power_of", wide("Heater", ["warm" if p else ("kalt", "lau")[k % 2] for k, p in enumerate(P)]), ("--power-on warm", "--power-column none")),
    Case("power_range.power_of", wide("Output", [p - 20 for p in P]), ("--power-levels -40 40",), notes=True),
    Case("power_range.with_one_unit", wide("Heater", [f"{p} %" if k % 2 else f"{20 * p} W" for k, p in enumerate(P)]),
         ("--power-full-scale 2000", "--power-column none")),
    Case("power_range._between", wide(), ("-power-levels --power-levels 4 20",), stated="--power-levels 0 0"),
    Case("power_range._between", wide(), ("-power-levels --power-levels 0 100",), stated="--power-levels 4 20"),
    Case("power_range._two_way", wide(values=[2 * p for p in P]), ("--power-full-scale 200",)),
    Case("power_range._two_way", wide(values=[-p for p in P]), ("--power-levels 0 -100 --cooler", "--power-levels -100 0"), tool="fit"),
    Case("power_range._two_way", wide(values=[p - 20 for p in P]), ("--power-levels -100 100",), notes=True),
    Case("power_range._offset", wide("Output", [4 + 0.16 * p for p in P]), ("-power-full-scale --power-full-scale 20", "-power-full-scale --power-levels 4 20"),
         stated="--power-full-scale 10"),
    Case("power_range._assumed", wide("Output [mA]", [5 + 0.15 * p for p in P]), ("--power-levels 4 20", "--power-full-scale 20", "--power-column none")),
    Case("power_range._assumed", wide("Output", [5 * p for p in P]), ("--power-full-scale 1000", "--power-column none")),
    Case("power_range._assumed", wide("Output", [p / 6 for p in P]), ("--power-full-scale 10",), notes=True),
    Case("power_range.with_switch", table("time [s],Temp [°C],A,B", S, T, *[["x" if p else "y" for p in P]] * 2), ("-power-on --power-on x --power-column A",),
         stated="--power-on x"),
    Case("quantities._demand_no_fractions", table("", S, [f"{20 + 0.07 * k:.2f}".replace(".", ",") for k in range(ROWS)], P), ("--decimal-comma 2", "--decimal-comma none")),
    Case("quantities._smoothest_join", table("time [s],Temp [°C],Heater [%]", S, [f"{20 + k % 7},{k * 3 % 10}" for k in range(ROWS)], P),
         ("--decimal-comma 2", "--decimal-comma 3")),
    Case("read._demand_no_sides", long({"T.Temp": T, "Heater.Power": P, "Cooling.Power": BOTH_ON}), ("--cooling-column none",), stated="--power-tag Heater.Power"),
    Case("read._readings", table(HEAD, S, BLANKS, P), ("--skip-empty",)),
    Case("read._by_room", table("time [s],PV [counts],Heater [%]", S, [round(400 * float(t)) for t in T], P), tuple(
        f"--temperature-unit {unit}" for unit in ("0.01degC", "degC", "degF", "K", "0.1degC", "0.1degF"))),
    Case("read._by_room", table("time [s],Temp,Heater [%]", S, [round(1000 * float(t)) for t in T], P), ("--temperature-scale 0.001",)),
    Case("read._temperature_unit", table("time [s],PV,Heater [%]", S, [float(t) + 20 for t in T], P), ("--temperature-unit degF",), notes=True),
    Case("read._in_degC", table("time [s],Temp [K],Heater [%]", S, T, P), ("--temperature-unit degC",)),
    Case("read._in_degC", table(f"{HEAD},Setpoint [°C]", S, T, P, [-300] * ROWS), ("--setpoint-column none",)),
    Case("read._with_cooling", table(f"{HEAD},Cooling [%]", S, T, P, BOTH_ON), ("--cooling-column none --disturbance-column \"Cooling [%]\"",)),
    Case("side_columns.demand_no_likely_power", table("time [s],Temp [°C],foo", S, T, P), ("--power-column foo", "--power-column none")),
    Case("side_columns.scale_question", table("time [s],Temp [°C],foo", S, T, P), ("--power-column foo --power-full-scale 100",)),
    Case("side_columns.demand_no_likely_power", table("time [s],Temp [°C],foo", S, T, ["zu" if p else "auf" for p in P]),
         ("--power-on zu", "--power-on auf", "--power-column none")),
    Case("side_columns.demand_own_temperature", table("time [s],Room temp [°C],foo,Heater [%]", S, [f"{20 + 0.1 * (k % 3):.1f}" for k in range(ROWS)],
                                                      [f"{float(t) - 0.3 * (k % 2):.1f}" for k, t in enumerate(T)], P),
         ("--temperature-column foo", '--temperature-column "Room temp [°C]"')),
    Case("tags._demand_long", wide(), ("-power-tag",), stated="--power-tag A", only_shown=("--power-tag", "--temperature-column")),
    Case("tags._demand_long", wide(), ("-tag-column",), stated='--tag-column "Heater [%]"', only_shown=("--tag-column", "--tag", "--temperature-column")),
    Case("tags._demand_long", long({"A": T, "B": P}, value="foo"), ("--temperature-column foo",), stated="--tag A --power-tag B", only_shown=("--power-tag",)),
    Case("tags._one_tag", table("time [s],Temp [°C],Heater [%],Channel", S, T, P, ["a"] * ROWS), ("-tag --tag a --tag-column Channel",), stated="--tag z"),
    Case("tags._without_bad", table(f"{HEAD},Quality", S, T, P, ["Bad"] * ROWS), ("--quality-column none",)),
    Case("tags._roles", long({"foo": T, "bar": P}), ("--tag foo --power-tag bar", "--tag foo --power-tag none")),
    Case("tags._demand_no_likely_power", long({"T.Temp": T, "xyz": P}), ("--power-tag xyz", "--power-tag none")),
    Case("tags._time", long({"T.Temp": T, "Heater.Power": P}, time="When"), ("--time-column When", "--time-column 1")),
    Case("tags._power_place", table("time [s],Temp [°C]", S, T), ("--power-column B",), other=table("time [s],Power A,B,Power C", S, P, P, P)),
    Case("tags.common_instants", table("time [s],Temp [°C]", S, T), ("--time-unit s",), other=table("time [ms],Power [%]", S, P)),
)
if importlib.util.find_spec("python_calamine") is not None:
    SHEETS = [[*HEAD.split(",")], *([s, float(t), p] for s, t, p in zip(S, T, P, strict=True))], [["Second"], *([k] for k in range(ROWS // 2))]
    CASES += (Case("formats/containers._workbook", _xlsx(*SHEETS), ("--tag Sheet2",), notes=True, name="log.xlsx"),)


#: functions that return a part of a message
PARTS = ("cleaning._put_back_repeats", "cleaning._other_column", "power_range._offset", "read._by_room", "side_columns.scale_question")


def named_options():
    """Return function → the options that its texts name, of `heatertune.log`."""
    found = {}
    for path in sorted(FOLDER.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        constants = {node.targets[0].id if isinstance(node, ast.Assign) else node.target.id: node for node in tree.body
                     if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Constant | ast.JoinedStr)}
        for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
            doc = ast.get_docstring(function, clean=False)
            used = [constants[node.id] for node in ast.walk(function) if isinstance(node, ast.Name) and node.id in constants]
            texts = [node.value for part in (function, *used) for node in ast.walk(part)
                     if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value != doc]
            if options := {option for text in texts for option in OPTION.findall(text)}:
                found[f"{path.relative_to(FOLDER).with_suffix('')}.{function.name}"] = options
    return found


def typed(case):
    """Return the options that the cases of a function type."""
    return {option for each in CASES if each.site == case for way in (*each.ways, each.stated, *each.only_shown) for option in OPTION.findall(way)}


def test_every_function_that_names_an_option_has_a_case_that_types_it():
    named = named_options()
    assert len(named) > 35
    assert {*named} == {case.site for case in CASES} | {"formats/containers._workbook"}  # whose library may not be there
    untried = {site: options - typed(site) for site, options in named.items() if options - typed(site)}
    assert untried == ({} if importlib.util.find_spec("python_calamine") else {"formats/containers._workbook": {"--tag"}})


def words_of(text):
    return [part.strip('"') for part in re.findall(r'"[^"]*"|\S+', text)]


def without(words, way):
    """Return the words without the option that a way takes back, and the words of the way."""
    more = words_of(way)
    if more and re.match(r"-[a-z]", more[0]):
        at = words.index(f"-{more.pop(0)}")
        end = next((i for i in range(at + 1, len(words)) if words[i].startswith("--")), len(words))
        words = words[:at] + words[end:]
    return words + more


@pytest.mark.parametrize("case", CASES, ids=[f"{number} {case.site}" for number, case in enumerate(CASES)])
def test_what_a_reader_names_is_typed_and_it_goes_on(case, tmp_path, monkeypatch):
    sites, plain = set(), LogError.__init__

    def recorded(self, *words, **options):
        frame = sys._getframe(1)
        while frame is not None:
            path = Path(frame.f_code.co_filename)
            if path.is_relative_to(FOLDER):
                sites.add(f"{path.relative_to(FOLDER).with_suffix('')}.{frame.f_code.co_name}")
            frame = frame.f_back
        plain(self, *words, **options)

    monkeypatch.setattr(LogError, "__init__", recorded)
    (file := tmp_path / case.name).write_bytes(case.content if isinstance(case.content, bytes) else case.content.encode())
    stated = words_of(case.stated)
    if case.other is not None:
        (second := tmp_path / "power.csv").write_text(case.other, encoding="utf-8")
        stated += ["--power-log", str(second)]
    status, out, err = command([case.tool, str(file), *stated])
    said = out + err if case.notes else err
    assert (status == 0) == case.notes, said
    if not case.notes and case.site not in PARTS:
        assert case.site in sites, (sites, err)
    options = set(OPTION.findall(said.partition("The same with nothing left")[0]))
    for way in case.ways:
        after, out, err = command([case.tool, str(file), *without(stated, way)])
        asked = [option for option in OPTION.findall(way) if f"-{way.split()[0]}" != option or way.startswith("--")]
        assert not asked or options & {*asked}, (said, way)
        assert after == 0 or "error:" in err, err
        assert after == 0 or err.partition("error:")[2] != said.partition("error:")[2], (way, err)
        assert after == 0 or OPTION.search(err.partition("error:")[2]), (way, err)
