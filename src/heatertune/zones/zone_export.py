"""The programs of all zones: for one PLC one program with the blocks of each zone; otherwise a folder for each zone.

The statements are those of the export of one heater. What belongs to one heater gets numbers and addresses of its own;
for STEP 7, what OB 35 does for a heater becomes a function block that OB 35 calls for each zone.

Decoupled zones read their neighbours' sensors at the instant of their own reading, in REALs and in the order of
`heatertune.zones.joint_kernel.neighbours_pct`: of STEP 7 into DISV, in structured text around the block. A reading that
tells of a broken sensor is left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final, NamedTuple

from heatertune.errors import ExportRefused, InputError
from heatertune.plc import Certificate, controller_for
from heatertune.plc.cpu.s7_300.program import LEAST
from heatertune.plc.cpu.s7_300.source import real
from heatertune.plc.inputs import FOUR_TO_TWENTY
from heatertune.plc.s5_ob251.blocks import PERIOD_ENDS
from heatertune.plc.s5_ob251.step import FULL_SCALE
from heatertune.plc.single_precision import single
from heatertune.plc.st.program_text import comment, literal
from heatertune.zones.decoupling import decoupling_arrays, neighbours_in
from heatertune.zones.joint_proof import JointProof

__all__ = ["demand_pass", "export_zones", "text_of_zone"]

#: where the function block and the program of one heater begin in structured text
_ST_BLOCK: Final = "\nFUNCTION_BLOCK "
_ST_PROGRAM: Final = "\nPROGRAM Heater"

_BETWEEN: Final = 10  # numbers of blocks from one zone to the next
#: target → zones whose heaters are the bits of one byte of outputs, and whose blocks have numbers of their own
_MOST: Final = {"s5-ob251": 8, "s7-300": 8, "fb41": 6}
_BLOCK: Final = re.compile(r"^(FUNCTION_BLOCK|DATA_BLOCK|FUNCTION|ORGANIZATION_BLOCK) (.+?)\n.*?^END_\1\n",
                           re.DOTALL | re.MULTILINE)
_NO_FILE_NAME: Final = re.compile(r"[^\w-]")
_LINE_END: Final = "\r\n"  # of a source of STEP 7
#: of the interrupt: not those of the CPU
_OWN_TEMPORARIES: Final = re.compile(r"^  [a-z]+ : (?:D?INT|WORD|BOOL|REAL) ;$", re.MULTILINE)
#: targets whose program of all zones makes their PWM by one clock
_ONE_CLOCK: Final = ("s7-300", "s5-ob251", "iec-pid", "fb41")
#: target of STEP 7 → where its PWM counts the ticks of the period
_CLOCKS: Final = {"s7-300": "DB102.DBD    12", "fb41": "DB102.DBD    18"}


def export_zones(proof: JointProof, *, force: bool = False) -> dict[str, str | bytes]:
    """Return the files of proven words of all zones, name → content.

    Args:
        proof: of all zones together.
        force: export although the verdict is not PASS.

    Raises:
        ExportRefused: the verdict is not PASS and `force` was not given.
        InputError: more zones than a program has outputs for, or staggered PWM periods for a target whose programs
            have no common clock.
    """
    demand_pass(proof, force=force)
    target, zones = proof.words[0].target, proof.fitted.network.zones
    demand_program(target, len(zones), staggered=any(proof.offsets_s))
    parts = []
    for zone, words, setpoint in zip(zones, proof.words, proof.specification.setpoints_degC, strict=True):
        parts.append(dict(controller_for(target).export(words, _certificate_of(proof, zone, setpoint))))
    program = _PROGRAMS.get(target)
    if program is None:
        folders = [f"zone{number}_{_NO_FILE_NAME.sub('_', zone)}" for number, zone in enumerate(zones, start=1)]
        return {f"{folder}/{name}": content for folder, part in zip(folders, parts, strict=True)
                for name, content in part.items()}
    return program(zones, parts, proof)


def demand_pass(proof: JointProof, *, force: bool) -> None:
    """Refuse the export of a proof that is no PASS and that nobody forces.

    Raises:
        ExportRefused: it is neither.
    """
    if proof.verdict != "PASS" and not force:
        raise ExportRefused(f"{proof.summary().splitlines()[0]}; --force exports these parameters anyway")


def _certificate_of(proof: JointProof, zone: str, setpoint_degC: float) -> Certificate:
    """Return what the files of a zone say about the proof."""
    target, section = proof.words[0].target, _section_of(zone, proof.words[0].target)
    alone = () if section or target in _PROGRAMS else (
        f"zone {zone} alone: the files of the other zones use the same names and addresses; give each a controller "
        "of its own, or names and addresses of its own",)
    certificate = proof.certificate()
    return replace(certificate, setpoint_degC=setpoint_degC, switches={**proof.switches, **section},
                   lines=(*certificate.lines, *alone))


def _section_of(zone: str, target: str) -> dict[str, str]:
    """Return the section of a printer's configuration that a zone's name means: "bed" is the heater_bed."""
    heaters = next((switch.settings for switch in controller_for(target).switches if switch.name == "heater"), ())
    generic = "heater_generic" if "heater_generic" in heaters else None
    name = next((each for each in heaters if zone.casefold() in (each, each.removeprefix("heater_"))), generic)
    return {} if name is None else {"heater": name}


def demand_program(target: str, zones: int, *, staggered: bool) -> None:
    """Refuse what no program of a target can do: raise InputError as `export_zones`.

    Args:
        target: the controller of all zones.
        zones: how many there are.
        staggered: whether their PWM periods begin one after the other.
    """
    if staggered and target not in _ONE_CLOCK:
        raise InputError(f"the programs of {target} have no common clock, by which their PWM periods could begin one "
                         "after the other: leave out --peak-power and --stagger, or take --target "
                         f"{' or '.join(_ONE_CLOCK)}")
    most = _MOST.get(target, zones)
    if zones > most:
        raise InputError(f"{zones} zones: a program of {target} has outputs and blocks for {most}; make two groups "
                         "that do not touch, or take a target with files of its own for each zone (heatertune targets)")


def _s5(zones: Sequence[str], parts: Sequence[Mapping[str, str | bytes]], proof: JointProof) -> dict[str, str | bytes]:
    """Return one listing: DB 30 and 31, FB 30 and 31 of the first zone, 40 and 41 of the second, and so on."""
    files: dict[str, str | bytes] = {}
    listing, calls, starts = [], [], []
    for number, (zone, part) in enumerate(zip(zones, parts, strict=True)):
        for name, content in part.items():
            moved = name.replace("DB30", f"DB{30 + _BETWEEN * number}")
            if name != "program_listing.txt":
                files[moved] = _s5_moved(content, number) if isinstance(content, str) else content
        text = _s5_moved(_s5_delayed(str(part["program_listing.txt"]), number, proof), number)
        head, _, rest = text.partition(f"\nDB{30 + _BETWEEN * number}\n")
        blocks = rest.partition("\nOB 1\n")[0]
        listing += [f"// zone {number + 1} of {len(zones)}: {zone}", *filter(str.strip, head.splitlines()), ""]
        listing += [f"DB{30 + _BETWEEN * number}", blocks, ""]
        calls += [f"     :JU FB {30 + _BETWEEN * number}", "NAME :HEAT"]
        starts += [f"     :JU FB {31 + _BETWEEN * number}", "NAME :START"]
    listing += ["OB 1", "     :BE", "", "OB 13", *calls, "     :BE", ""]
    listing += [line for block in ("OB 21", "OB 22") for line in (block, *starts, "     :BE", "")]
    return {"program_listing.txt": "\n".join(listing), **files}


def _s5_moved(text: str, number: int) -> str:
    """Return a listing with the blocks, inputs and outputs of a zone."""
    shift = _BETWEEN * number
    text = re.sub(r"\b(DB|FB)( ?)(3[0-3])\b", lambda m: f"{m[1]}{m[2]}{int(m[3]) + shift}", text)
    text = re.sub(r"\bPW (128|176)\b", lambda m: f"PW {int(m[1]) + 2 * number}", text)
    text = re.sub(r"\bPY 4\b", f"PY {4 + number}", text)
    return re.sub(r"\bI 0\.0\b", f"I 0.{number}", re.sub(r"\bQ 4\.0\b", f"Q {4 + number}.0", text))


class _Step7(NamedTuple):
    """The source of one heater, the blocks that serve all zones, those of each zone, and the source of all zones."""

    source: str
    shared: tuple[str, ...]
    own: tuple[str, ...]
    title: str


_PID_TIP: Final = _Step7("s7_300_pid.awl", ("FB 100", "FB 101"), ("DB 100", "DB 102", "DB 101", "FC 101 : VOID"),
                         "s7_300_zones.awl")
_CONT_C: Final = _Step7("fb41_cont_c.awl", ("FB 101",), ("DB 41", "DB 102", "DB 101", "FC 101 : VOID"),
                        "fb41_zones.awl")


def _s7(
    form: _Step7, zones: Sequence[str], parts: Sequence[Mapping[str, str | bytes]], proof: JointProof
) -> dict[str, str | bytes]:
    """Return one source: FB 100 and 101 for all zones; DB, FC and FB from 100 of the first zone, 110 of the second.

    Instances of CONT_C are DB 41, 51 and so on.
    """
    files: dict[str, str | bytes] = {}
    shared: dict[str, str] = {}
    heads, zone_blocks, loads, calls = list[str](), list[str](), list[str](), list[str]()
    for number, (zone, part) in enumerate(zip(zones, parts, strict=True)):
        shift = _BETWEEN * number
        files |= {f"zone{number + 1}_{name}": content for name, content in part.items() if not name.endswith(".awl")}
        source = str(part[form.source]).replace("\r\n", "\n")
        if "FB 101" not in source:
            raise InputError("this PWM is left to a switch behind the analog output, which a program of zones does not "
                             "have: leave out --pwm-rule, or state a --pwm-period that OB 35 makes")
        source = _decoupled_cont_c(_s7_delayed(source, number, proof), number, proof)
        blocks = {match[2]: match[0] for match in _BLOCK.finditer(source)}
        heads += [f"// zone {number + 1} of {len(zones)}: {zone}", *(
            _s7_moved(line, number) for line in source.splitlines() if line.startswith("//"))]
        shared |= {name: blocks[name] for name in form.shared}
        zone_blocks += [_s7_moved(blocks[name], number) for name in form.own]
        zone_blocks.append(_s7_moved(_as_function_block(blocks["OB 35"], zone), number))
        start = blocks["OB 100"]
        loads.append(_s7_moved(start[start.index("NETWORK"):start.index("END_ORGANIZATION_BLOCK")], number))
        calls += ["NETWORK", f"TITLE =zone {zone}", f"      CALL  FB {102 + shift} , DB {103 + shift} (",
                  "           OB35_EXC_FREQ := #OB35_EXC_FREQ);"]
    start, tick = blocks["OB 100"], blocks["OB 35"]
    restart = f"{start[:start.index('NETWORK')]}{''.join(loads)}END_ORGANIZATION_BLOCK\n"
    cyclic = re.sub(_OWN_TEMPORARIES.pattern + "\n", "", tick[:tick.index("NETWORK")], flags=re.MULTILINE)
    text = "\n".join(["\n".join(heads), *shared.values(), *zone_blocks, restart, cyclic + "\n".join(calls),
                      "END_ORGANIZATION_BLOCK\n"])
    return {form.title: text.replace("\n", _LINE_END), **files}


def _delayed(text: str, proof: JointProof, changes: Sequence[tuple[str, str]]) -> str:
    """Return a program whose PWM periods follow one clock, whatever happens to the zone; its own where none is delayed.

    Args:
        text: of the program.
        proof: of all zones together.
        changes: pattern, which the text holds once, and what takes its place.
    """
    for pattern, changed in changes if any(proof.offsets_s) else ():
        text, count = re.subn(pattern, changed, text)
        if count != 1:
            raise InputError("the program has no PWM whose beginning can be moved: leave out --peak-power and "
                             "--stagger, and --pwm-rule and --pwm-period where they are stated")
    return text


def _ticks(proof: JointProof, number: int) -> tuple[int, int]:
    """Return after how many ticks the first PWM period of a zone begins, and how many a period has."""
    tick_s = proof.actuator.resolution_s
    return round(proof.offsets_s[number] / tick_s), round(proof.actuator.pwm_period_s / tick_s)


def _s7_delayed(source: str, number: int, proof: JointProof) -> str:
    """Return a source of STEP 7 in which FC 101 leaves the PWM's clock alone, and OB 100 sets it for its zone."""
    late, period = _ticks(proof, number)
    clock = _CLOCKS[proof.words[0].target]
    zero = (r"(COM_RST := TRUE\);\n      L     0.00000000e\+000;\n)", r"\1      T     DB41.DBD   72;\n")
    return _delayed(source, proof, (  # the PWM goes on, and takes what is left in LMN
        *([zero] if proof.words[0].target == "fb41" else []),
        (rf" +T +{clock};[^\n]*\n", ""),
        (r"(off: +CALL  FC 101;\n)      BEU   ;", r"\1      JU    out;"),
        (r"(\n      CALL  FC 101;\n)", rf"\1      L     L#{-late % period};\n      T     {clock};\n"),
        (r"  TICK := L#0 ;", f"  TICK := L#{-late % period} ;")))


def _s5_delayed(listing: str, number: int, proof: JointProof) -> str:
    """Return a listing in which a start-up sets the staircase of the PWM for its zone, and nothing else does."""
    late, period = _ticks(proof, number)
    passed = (2 * (period - late) - 1) * FULL_SCALE  # risen before its first tick, times 2·period
    stair, ends = -(-passed // (2 * period)), PERIOD_ENDS
    rest = stair * 2 * period - passed
    return _delayed(listing, proof, (
        (rf"(KF = \+)0{ends}(; +STAIR)", rf"\g<1>{stair:05d}\2"), (r"(KF = \+)00000(; +REST)", rf"\g<1>{rest:05d}\2"),
        (rf"     :L  KF \+{ends}\n     :T  DW 6\n(     :L  KF \+0\n     :T  DW 4\n)", r"\1     :T  DW 8\n"),
        (rf"(:L  KF \+){ends}( +;).*(\n     :T  DW 6\n)(     :L  KF \+0\n     :T  DW 4\n)     :T  DW 7\n",
         rf"\g<1>{stair}\2 and sets the clock of the PWM\3     :L  KF +{rest}\n     :T  DW 7\n\4")))


def _as_function_block(block: str, zone: str) -> str:
    """Return what OB 35 does for a heater as a function block with its instance."""
    body = block[block.index("BEGIN\n"):].replace("END_ORGANIZATION_BLOCK", "END_FUNCTION_BLOCK")
    own = _OWN_TEMPORARIES.findall(block)
    return "\n".join([
        "FUNCTION_BLOCK FB 102", f"TITLE =one tick of zone {zone}", "VERSION : 0.1", "VAR_INPUT",
        "  OB35_EXC_FREQ : INT ;  // ms", "END_VAR", "VAR_TEMP", *own, "END_VAR", body,
        "DATA_BLOCK DB 103", f"TITLE =instance of the tick of zone {zone}", "VERSION : 0.1", "FB 102", "BEGIN",
        "  OB35_EXC_FREQ := 0 ;", "END_DATA_BLOCK", ""])


def _s7_moved(text: str, number: int) -> str:
    """Return a source with the data blocks, functions, inputs and outputs of a zone; FB 100 and 101 serve all.

    The inputs of its neighbours, which the source names, stay.
    """
    shift = _BETWEEN * number
    text = re.sub(r"\b(DB ?|FC )(10[0-3]|41)\b", lambda m: f"{m[1]}{int(m[2]) + shift}", text)
    text = re.sub(r"\bFB 102\b", f"FB {102 + shift}", text)
    return re.sub(r"\bPIW 256\b(?!;  // zone)", f"PIW {256 + 2 * number}", re.sub(r"\bQ 4\.0\b", f"Q 4.{number}", text))


def _st_source(sources: Sequence[tuple[str, str]]) -> str:
    """Return one source of the programs of all zones, Heater1, Heater2 and so on, each behind the remarks on its zone.

    Args:
        sources: of each zone its name and the text of its program, all with the same function block.
    """
    blocks, programs = "", list[str]()
    for number, (zone, text) in enumerate(sources, start=1):
        head, _, rest = text.partition(_ST_BLOCK)
        block, _, program = rest.partition(_ST_PROGRAM)
        blocks = f"{_ST_BLOCK.lstrip()}{block}\n"
        title = comment(f"zone {number} of {len(sources)}: {zone}; run Heater{number} from the same task as the others")
        programs.append(f"{title}{head}{_ST_PROGRAM}{number}{program}")
    return blocks + "\n".join(programs)


def _st_delayed(source: str, number: int, proof: JointProof) -> str:
    """Return a source of structured text whose PWM runs on while the zone is off."""
    (late, period), tick_ms = _ticks(proof, number), round(1000.0 * proof.actuator.resolution_s)
    return _delayed(source, proof, (
        (r"(  HeaterPhase : DINT := )0;", rf"\g<1>{(period - late - 1) * tick_ms};"),
        (r"IF HeaterOn AND HeaterWasOn THEN\n  (HeaterPhase := HeaterPhase \+ ScanMs;\n)ELSE\n.*\nEND_IF;\n", r"\1")))


def _st(zones: Sequence[str], parts: Sequence[Mapping[str, str | bytes]], proof: JointProof) -> dict[str, str | bytes]:
    """Return one source of structured text; a PLCopen project is that of one program."""
    sources = [(zone, _decoupled_text(_st_delayed(str(part["iec_pid.st"]), number, proof), number, proof))
               for number, (zone, part) in enumerate(zip(zones, parts, strict=True))]
    return {"iec_pid_zones.st": _st_source(sources)}


_PROGRAMS: Final[dict[str, Callable[..., dict[str, str | bytes]]]] = {
    "s5-ob251": _s5, "s7-300": partial(_s7, _PID_TIP), "fb41": partial(_s7, _CONT_C), "iec-pid": _st}
_MOVED: Final[dict[str, Callable[[str, int], str]]] = {
    "s5-ob251": _s5_moved, "s7-300": _s7_moved, "fb41": _s7_moved}


def text_of_zone(target: str, text: str, number: int) -> str:
    """Return a text on one heater's program with the blocks, inputs and outputs of a zone; the first zone has 0."""
    return _MOVED[target](text, number) if target in _MOVED else text


_DISV: Final = "DB41.DBD   68"
_TICK: Final = 2  # bytes from the analog input of a zone to that of the next one


def _decoupled_cont_c(source: str, number: int, proof: JointProof) -> str:
    """Return a source of STEP 7 in which OB 35 writes DISV before it calls CONT_C; as it is without decoupling.

    Args:
        source: of one heater.
        number: of the zone.
        proof: of all zones together.
    """
    if proof.design.decoupling is None:
        return source
    body = "\n".join(_disv_statements(number, proof))
    source = _once(r"(      CALL  FB 41 , DB 41 \(\n           COM_RST := FALSE,)", rf"{body}\n\1", source)
    source = _once(r"(  manual : BOOL ;\n)", r"\1  near : INT ;\n", source)
    remark = f"// {_remark(number, proof)}; put the addresses of their inputs in FB 102, too"
    return _once(r"(// verdict of the proof)", rf"{remark}\n\1", source)


def _disv_statements(number: int, proof: JointProof) -> Iterator[str]:
    words = proof.words[number]
    low = [f"      L     {LEAST};  // 3.6 mA", "      <I    ;"] if words.scaling.input == FOUR_TO_TWENTY else [
        "      L     -32768;", "      ==I   ;"]
    yield from (f"      L     {real(0.0)};", f"      T     {_DISV};  // power for the neighbours' temperatures")
    for other, factor, reference in neighbours_in(decoupling_arrays(proof.design.decoupling, proof.words), number):
        end, address = f"nb{other + 1}", 256 + _TICK * other
        yield from (
            f"      L     PIW{address:4d};  // zone {other + 1}", "      T     #near;", "      L     32767;",
            "      ==I   ;", f"      JC    {end};", "      L     #near;", *low, f"      JC    {end};",
            "      L     #near;", "      ITD   ;", "      DTR   ;", f"      L     {real(reference)};", "      -R    ;",
            f"      L     {real(factor)};", "      *R    ;", f"      L     {_DISV};", "      +R    ;",
            f"      T     {_DISV};", f"{end}:  NOP   0;")


def _decoupled_text(source: str, number: int, proof: JointProof) -> str:
    """Return a source of structured text that adds power around the block; as it is without decoupling.

    Args:
        source: of one heater.
        number: of the zone.
        proof: of all zones together.
    """
    if proof.design.decoupling is None:
        return source
    words, zones = proof.words[number], proof.fitted.network.zones
    low, high = (literal(single(end)) for end in words.scaling.sensor_degC)
    variables, sums = "", "HeaterAdded := 0.0; (* for the temperatures of the neighbours whose sensors are well *)\n"
    for other, factor, reference in neighbours_in(decoupling_arrays(proof.design.decoupling, proof.words), number):
        name = f"HeaterZone{other + 1}"
        variables += (f"  {name} : REAL := {literal(reference)}; (* degC, temperature of zone {zones[other]}, from its "
                      f"input module *)\n  {name}Good : BOOL := FALSE; (* its sensor is well *)\n")
        sums += (f"IF {name}Good AND {name} >= {low} AND {name} <= {high} THEN\n"
                 f"  HeaterAdded := HeaterAdded + ({name} - ({literal(reference)})) * ({literal(factor)});\nEND_IF;\n")
    variables += "  HeaterAdded : REAL := 0.0; (* power for the neighbours' temperatures, % *)\n"
    sums = re.sub("^", "  ", sums, flags=re.MULTILINE).rstrip(" ")
    for pattern, changed in (
            (r"(  HeaterPid : HT_IEC_PID;\n)", rf"{variables}\1"),
            (r"(  HeaterPid\(\n)", rf"{sums}\1"),
            (r"X0 := HandPower", "X0 := HandPower - HeaterAdded"),
            (r"XMIN := (.+),", r"XMIN := \1 - HeaterAdded,"), (r"XMAX := (.+),", r"XMAX := \1 - HeaterAdded,"),
            (r"HeaterPower := HeaterPid.XOUT;", "HeaterPower := HeaterPid.XOUT + HeaterAdded;"),
            (r"(\(\* verdict of the proof)", rf"(* {_remark(number, proof)} *)\n\1"),
            (r"(PROGRAM Heater)", rf"(*   {_TEXT_STEP} *)\n\1")):
        source = _once(pattern, changed, source)
    return source


_TEXT_STEP: Final = ("wire HeaterZone1, HeaterZone2 ... to the temperatures of these zones, read in the same scan; "
                     "HeaterZone1Good ... must fall when that sensor breaks")


def _remark(number: int, proof: JointProof) -> str:
    """Return what the program adds, a line."""
    decoupling, zones = proof.design.decoupling, proof.fitted.network.zones
    assert decoupling is not None
    parts = [f"{factor:+.4g} % per degC of zone {zones[other]} above {decoupling.references_degC[other]:g} degC"
             for other, factor in enumerate(decoupling.pct_per_degC[number]) if factor != 0.0]
    return f"decoupled: {', '.join(parts) or 'nothing'}"


def _once(pattern: str, changed: str, text: str) -> str:
    text, count = re.subn(pattern, changed, text)
    if count != 1:
        raise InputError("the program of this controller has no place for decoupling: leave out --decouple, and "
                         "--pwm-rule and --pwm-period where they are stated")
    return text
