"""The block of each controller: what stands in it where, what a client may do to it, and that it runs as it was proven.

Addresses and digits are written here a second time, as a client has them from the manuals that the modules name.
"""

import csv
import io
import random
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.conftest import tried
from tests.live.conftest import CLIENTS, CONDITIONS, FAILED, Modbus, client, words_of

from heatertune import InputError, Scaling, Scenario
from heatertune import simulate as simulate_words
from heatertune.live.client.connection import address_of, connect
from heatertune.live.controller_block import SERVED, block_for, places_of
from heatertune.live.simulator_status import DEAD_MAN, OWN, OWN_LENGTH
from heatertune.plc import Certificate, controller_for
from heatertune.plc.core import ControllerState
from heatertune.plc.ramp import Boost, Ramp

TARGETS = tuple(SERVED)
#: whose state is whole in the block
KEPT = ("s5-ob251", "s7-300", "fb41")


def _s7(number, code, *starts, scale=1.0):
    def read(asking):
        size = struct.calcsize(code)
        return [scale * struct.unpack(code, asking.read(number, start, size))[0] for start in starts]

    return "s7", read


def _registers(code, *firsts, scale=1.0, low_first=False):
    def read(asking):
        found = []
        for first in firsts:
            words = asking.client.read_holding_registers(first, count=struct.calcsize(code) // 2, device_id=1).registers
            content = struct.pack(f">{len(words)}H", *(reversed(words) if low_first else words))
            found.append(scale * struct.unpack(code, content)[0])
        return found

    return "modbus", read


def _fb41(asking):
    setpoint, power = (struct.unpack(">f", asking.read(41, start, 4))[0] for start in (6, 72))
    return setpoint, struct.unpack(">h", asking.read(41, 14, 2))[0] / 276.48, power


#: target → protocol and what reads setpoint [°C], reading [°C] and power [%] there, with a sensor of 0…100 °C
WHERE = {
    "s7-200-pid": _s7(1, ">f", 104, 100, 108, scale=100.0),
    "s7-300": _s7(100, ">h", 4, 2, 6, scale=1.0 / 276.48),
    "fb41": ("s7", _fb41),
    "pid-compact": _s7(1, ">f", 0, 4, 8), "pid-temp": _s7(1, ">f", 0, 4, 8),
    "weg": _registers(">f", 1, 6, 24), "iec-pid": _registers(">f", 2048, 2050, 2052),
    "pband": _registers(">h", 1, 0, 2, scale=0.1), "omron-e5cc": _registers(">h", 0x2103, 0x2000, 0x2004, scale=0.1),
    "eurotherm-3200": _registers(">h", 2, 1, 4, scale=0.1), "omega-cn7800": _registers(">h", 0x1001, 0x1000, 0x1012, scale=0.1),
    "jumo-dicon": _registers(">f", 0x122F, 0x1231, 0x1233, low_first=True),
}


def _made(target, switches=None):
    controller, words = controller_for(target), words_of(target)
    return controller, words, block_for(controller, words, switches or {})


def _measured(target, *temperatures):
    return [controller_for(target).measure(words_of(target), each) for each in temperatures]


@pytest.mark.parametrize("target", TARGETS)
def test_a_run_released_scan_by_scan_is_that_of_the_proof_bit_for_bit(served, heater, target):
    words, scans = words_of(target), 120
    plc, scan_s = served(words), controller_for(target).timing(words).scan_s
    trace = simulate_words(words, heater, Scenario(setpoint_degC=50.0, duration_s=(scans - 1) * scan_s, noise_degC=0.0))
    told = [plc.release(1) for _ in range(scans)]
    np.testing.assert_array_equal([each.power_pct for each in told], trace.power_asked_pct[:scans])
    np.testing.assert_array_equal([each.temperature_degC for each in told], trace.temperature_degC[:scans])


@pytest.mark.parametrize(("target", "changed"), [
    ("s7-300", {"ramp": Ramp(step=40, calls=3, hold=2000)}), ("fb41", {"ramp": Ramp(step=40)}), ("s7-200", {"ramp": Ramp(step=1, calls=4)}),
    ("weg", {"ramp": Ramp(step=0.25, calls=2)}), ("weg", {"boost": Boost(within_degC=8.0, again_degC=12.0)}),
    ("iec-pid", {"boost": Boost(within_degC=8.0, again_degC=12.0)})])
def test_the_program_around_ramps_and_boosts_as_it_was_proven(served, heater, target, changed):
    words, scans = replace(words_of(target), **changed), 150
    plc, noisy = served(words, replace(CONDITIONS, noise_degC=0.2)), Scenario(setpoint_degC=50.0, duration_s=149 * 4.0, noise_degC=0.2)
    trace = simulate_words(words, heater, noisy)
    told = [plc.release(1) for _ in range(scans)]
    assert any(each.setpoint != told[-1].setpoint for each in told) == ("ramp" in changed)
    np.testing.assert_array_equal([each.power_pct for each in told], trace.power_asked_pct[:scans])


@pytest.mark.parametrize("target", WHERE)
def test_a_client_reads_setpoint_reading_and_power_where_the_manual_has_them(served, target):
    protocol, read = WHERE[target]
    plc = served(words_of(target), serve=protocol)
    with client(plc, protocol) as asking:
        for _ in range(5):
            told = plc.release(8)
            setpoint, reading, power = read(asking)
            assert setpoint == pytest.approx(50.0, abs=0.06)
            assert reading == pytest.approx(told.temperature_degC, abs=0.06)
            assert power == pytest.approx(told.power_pct, abs=0.06)


@pytest.mark.parametrize("target", TARGETS)
def test_the_projects_own_client_finds_the_same_where_the_block_says_that_it_shows_it(served, target):
    plc, places = served(words_of(target)), places_of(words_of(target))
    (protocol, (host, port)), = plc.addresses.items()
    first = plc.registers[0].first if len(plc.registers) == 1 else 0
    way = {"s7": "/0/2", "modbus": f"/1/{first}"}[protocol]
    with connect(address_of(f"{protocol}://{host}:{port}{way}")) as asking:
        for _ in range(5):
            told = plc.release(8)
            begin, count = places.span
            content = asking.read(places.block, begin, count)
            found = {role: signal.of(content, begin) for role, signal in places.signals.items()}
            assert found["temperature"] == pytest.approx(told.temperature_degC, abs=0.4 if target == "s7-200" else 0.06)
            if target != "s7-200":  # whose setpoint and pulse width are not in V memory
                assert found["setpoint"] == pytest.approx(50.0, abs=0.06)
                assert found["power"] == pytest.approx(told.power_pct, abs=0.06)


def test_the_papers_program_has_reading_and_error_in_v_memory_alone(served):
    plc = served(words_of("s7-200"))
    with client(plc) as asking:
        told = plc.release(20)
        reading, _, _, _, _, error = struct.unpack(">6h", asking.read(1, 0, 12))
        assert (reading, error) == (told.reading, told.setpoint - told.reading)
        assert struct.unpack(">3h", asking.read(1, 200, 6)) == tuple(words_of("s7-200").values[name] for name in ("KP", "KI", "KD"))


@pytest.mark.parametrize("target", TARGETS)
def test_a_word_that_somebody_writes_acts_as_it_would_have_from_the_beginning(served, target):
    """The controller's own step, told the readings that the sensor gave."""
    controller, words = controller_for(target), words_of(target)
    name = next(name for name in ("K", "KC", "KP", "GAIN", "Gain", "Kp", "P", "Pb", "PB", "XP1") if name in words.values)
    value = words.values[name] // 2 if isinstance(words.values[name], int) else 0.5 * words.values[name]
    plc = served(words, faults=f"t={19.5 * controller.timing(words).scan_s} word {name}={value}")
    running = controller.start(words, {})
    for scan in range(40):
        if scan == 20 and not target.startswith("s7-200"):
            running = ControllerState(controller.start(replace(words, values={**words.values, name: value}), {}).parameters, running.state)
        told = plc.release(1)
        if target.startswith("s7-200") and scan == 20:
            return  # its own memory holds the word: the next test
        running, expected = controller.step(running, *_measured(target, 50.0, told.temperature_degC))
        assert told.power_pct == expected.power_pct, scan


def test_a_constant_written_to_v_memory_is_what_the_papers_program_multiplies_by(served):
    plc, v = served(words_of("s7-200")), words_of("s7-200").whole
    before = plc.release(1)
    with client(plc) as asking:
        asking.write(1, 200, bytes(6))  # KP, KI, KD
        assert before.power_pct > 0.0
        assert v["KP"] != 0
        assert plc.release(5).power_pct == before.power_pct  # nothing is added to the pulse width


@pytest.mark.parametrize("target", KEPT)
def test_a_block_goes_on_where_another_was_left(target):
    """So its cells hold all of the state that the next calls depend on, to the last bit."""
    controller, _, one = _made(target)
    cells, state, chance = bytearray(one.image()), one.begin(), random.Random(7)
    readings = [controller.measure(words_of(target), 45.0 + chance.uniform(-4.0, 4.0)) for _ in range(60)]
    setpoint, = _measured(target, 50.0)
    for reading in readings[:30]:
        state, *_ = one.scan(cells, state, setpoint, reading)
    _, _, other = _made(target)
    copy, cold = bytearray(cells), other.begin()
    for reading in readings[30:]:
        state, *outcome = one.scan(cells, state, setpoint, reading)
        cold, *again = other.scan(copy, cold, setpoint, reading)
        assert (outcome, bytes(cells)) == (again, bytes(copy))


def _settings(target):
    """Each setting of each switch, the others at their defaults."""
    return [{}, *({switch.name: setting} for switch in controller_for(target).switches for setting in switch.settings[1:])]


#: numbers that no program has written: not a number, infinite, subnormal, smallest and largest whole ones
_ODD = [struct.pack(">I", pattern) for pattern in (
    0x7FC00000, 0xFFC00001, 0x7F800001, 0x7F800000, 0xFF800000, 1, 0x80000000, 0x7FFFFFFF, 0x7F7FFFFF, 0xFF7FFFFF, 0)]


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
@given(content=st.data())
def test_a_scan_takes_any_pattern_of_bits(target, content):
    _, _, block = _made(target, content.draw(st.sampled_from(_settings(target))))
    cells, state = bytearray(block.image()), block.begin()
    length, temperatures = len(cells), _measured(target, -9.0, 22.0, 50.0, 200.0)
    for _ in range(3):
        place = 2 * content.draw(st.integers(0, (length - 4) // 2))
        what = content.draw(st.sampled_from(_ODD) | st.binary(min_size=1, max_size=length - place))
        cells[place : place + len(what)] = what
        state, power, _, _ = block.scan(cells, state, *(content.draw(st.sampled_from(temperatures)) for _ in range(2)))
        assert len(cells) == length
        assert 0.0 <= power <= 100.0 or power != power  # noqa: PLR0124 - what is no number the loop takes as none


@pytest.mark.brute
@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_whole_random_blocks_and_odd_numbers_everywhere_stop_no_plc(target):
    chance = random.Random(9)
    for switches in _settings(target):
        _, words, block = _made(target, switches)
        cells, state = bytearray(block.image()), block.begin()
        setpoint, = _measured(target, 50.0)
        for number in range(tried(150, 1_500)):
            kind = number % 3
            if kind == 0:
                cells[:] = chance.randbytes(len(cells))
            elif kind == 1:
                place = 2 * chance.randrange((len(cells) - 2) // 2)
                cells[place : place + 4] = chance.choice(_ODD)[: len(cells) - place]
            else:
                cells[:] = (chance.choice(_ODD) * len(cells))[: len(cells)]
            if chance.random() < 0.1:
                state = block.restarted(state)
            state, power, _, _ = block.scan(cells, state, setpoint, controller_for(target).measure(words, chance.uniform(-9, 130)))
            assert 0.0 <= power <= 100.0 or power != power  # noqa: PLR0124


#: target → (protocol, writes to manual and its power of 40 %)
MANUAL = {
    "s7-300": ("s7", lambda asking: (asking.write(100, 0, b"\0"), asking.write(100, 6, struct.pack(">h", 11059)))),
    "fb41": ("s7", lambda asking: (asking.write(41, 0, bytes([asking.read(41, 0, 1)[0] | 2])),
                                   asking.write(41, 16, struct.pack(">f", 40.0)))),
    "weg": ("modbus", lambda asking: asking.write(0, 2 * 3, struct.pack(">fH", 40.0, 1))),
    "iec-pid": ("modbus", lambda asking: asking.client.write_registers(2054, list(struct.unpack(">4H", struct.pack(">fi", 40.0, 0))),
                                                                       device_id=1)),
}


@pytest.mark.parametrize("target", MANUAL)
def test_in_manual_the_power_is_the_clients_until_nobody_is_there(served, target):
    protocol, by_hand = MANUAL[target]
    plc = served(words_of(target), serve=protocol, dead_man=20)
    plc.release(100)
    with client(plc, protocol) as asking:
        by_hand(asking)
        assert plc.release(19).power_pct == pytest.approx(40.0, abs=0.01)
        told = plc.release(40)
    assert told.status & DEAD_MAN
    assert told.power_pct != pytest.approx(40.0, abs=0.01)


@pytest.mark.parametrize("target", ["s5-ob251", "weg", "iec-pid"])
def test_one_request_puts_it_in_manual_and_the_bytes_before_bring_back_what_was(served, target):
    _, words, block = _made(target)
    plc = served(words, serve="modbus")
    first = plc.registers[0].first
    with connect(address_of(f"modbus://127.0.0.1:{plc.addresses['modbus'][1]}/1/{first}")) as asking:
        plc.release(100)
        image = asking.read(plc.number, 0, plc.length)
        start, content = block.put_in_manual(image, 37.5)
        asking.write(plc.number, start, content)
        assert plc.release(8).power_pct == pytest.approx(37.5, abs=0.1)
        asking.write(plc.number, start, image[start : start + len(content)])
        assert not block.in_manual(asking.read(plc.number, 0, plc.length))


@pytest.mark.parametrize(("target", "why"), [
    ("fb41", "told mode and power in manual by its program"), ("s7-300", "told mode and power in manual by its program"),
    ("pid-compact", "no manual mode here"), ("omron-e5cc", "no manual mode here"), ("s7-200", "have no manual mode")])
def test_without_manual_in_one_request_there_is_no_experiment(target, why):
    _, _, block = _made(target)
    with pytest.raises(InputError, match=why):
        block.put_in_manual(block.image(), 50.0)


def test_without_a_manual_mode_no_dead_man_is_promised(served):
    with pytest.raises(InputError, match="--dead-man is for a controller with a manual mode; pid-compact has none here"):
        served(words_of("pid-compact"), dead_man=3)


@pytest.mark.parametrize("target", TARGETS)
def test_after_a_stop_it_begins_as_its_program_does(served, target):
    """The core's own `restarted`, told the readings that the sensor gave."""
    controller, words = controller_for(target), words_of(target)
    scan_s = controller.timing(words).scan_s
    plc, running = served(words, faults=f"t={29.5 * scan_s} cpu-stop until={39.5 * scan_s}"), controller.start(words, {})
    cold = controller.start(words, {}).state
    for scan in range(60):
        told = plc.release(1)
        if 30 <= scan < 40:
            assert told.power_pct == 0.0
            continue
        if scan == 40:
            own = controller.core.own(running.state)
            running = running._replace(state=controller.core.warm_start(running.parameters, cold, own))
        running, expected = controller.step(running, *_measured(target, 50.0, told.temperature_degC))
        assert told.power_pct == expected.power_pct, scan


#: target → protocol; the gain's byte, and whether it stays through a start-up; the setpoint's byte, 40 °C there, and whether it does
STAYS = {
    "s7-300": ("s7", (10, False), (4, struct.pack(">h", 11059), True)),  # OB100 loads its words
    "fb41": ("s7", (20, True), (6, struct.pack(">f", 40.0), True)),
    "pid-compact": ("s7", (12, True), (0, struct.pack(">f", 40.0), True)),
    "weg": ("modbus", (24, False), (2, struct.pack(">f", 40.0), False)),  # its ladder retains nothing
}


@pytest.mark.parametrize("target", STAYS)
def test_a_start_up_leaves_what_the_plc_retains_and_the_rest_as_loaded(served, target):
    protocol, (gain, gain_stays), (setpoint, asked, setpoint_stays) = STAYS[target]
    words = words_of(target)
    scan_s = controller_for(target).timing(words).scan_s
    plc = served(words, serve=protocol, faults=f"t={5.5 * scan_s} cpu-stop until={7.5 * scan_s}")
    with client(plc, protocol) as asking:
        def both():
            return asking.read(plc.number, gain, 4), asking.read(plc.number, setpoint, len(asked))

        plc.release(3)
        before, written = both(), (struct.pack(">f", 0.125), asked)
        asking.write(plc.number, gain, written[0])
        asking.write(plc.number, setpoint, asked)
        assert plc.release(2).scans == 5
        assert both() == written
        assert plc.release(7).scans == 10
        assert both() == ((written if gain_stays else before)[0], (written if setpoint_stays else before)[1])


def test_cont_c_without_pvper_on_reads_pv_in(served):
    plc = served(words_of("fb41"))
    with client(plc) as asking:
        plc.release(50)
        asking.write(41, 10, struct.pack(">f", 80.0))
        asking.write(41, 0, bytes([asking.read(41, 0, 1)[0] & ~4]))
        told = plc.release(3)
        assert told.power_pct == 0.0
        assert struct.unpack(">f", asking.read(41, 92, 4))[0] == 80.0  # PV


# instruments


@pytest.mark.parametrize("target", [target for target in WHERE if target in SERVED and SERVED[target][0] == "instrument"])
def test_parameters_stand_at_the_registers_that_the_exported_list_names(served, target):
    words = words_of(target)
    rows = [line for name, text in controller_for(target).export(words, Certificate(verdict="PASS")).items()
            if name.endswith(".csv") for line in text.splitlines() if not line.startswith("#")]
    plc = served(words)
    with client(plc, "modbus") as asking:
        for number, row in enumerate(csv.DictReader(io.StringIO("\n".join(rows)))):
            real = row["format"] == "FLOAT"
            first = int(row["address"]) if row["address"].isdigit() else 3 + number  # the generic one has names alone
            found = asking.client.read_holding_registers(first, count=1 + real, device_id=1).registers
            value = struct.unpack(">f", struct.pack(">2H", *reversed(found)))[0] if real else struct.unpack(">h", struct.pack(">H", *found))[0]
            assert value == words.values[row["name"]], row["name"]


def test_a_number_out_of_its_range_an_instrument_puts_back_and_goes_on_with_the_one_before(served):
    plc, words = served(words_of("omron-e5cc")), words_of("omron-e5cc")
    with client(plc, "modbus") as asking:
        plc.release(3)
        for number in (0, 10000):
            asking.client.write_registers(0x2A00, [number], device_id=1)
            plc.release(1)
            assert asking.client.read_holding_registers(0x2A00, count=1, device_id=1).registers == [words.values["P"]]
        asking.client.write_registers(0x2A00, [333], device_id=1)
        plc.release(2)
        assert asking.client.read_holding_registers(0x2A00, count=1, device_id=1).registers == [333]


def test_a_setpoint_in_tenths_of_a_degree_is_what_the_instrument_goes_to(served):
    plc = served(words_of("omega-cn7800"))
    with client(plc, "modbus") as asking:
        plc.release(1)
        asking.client.write_registers(0x1001, [615], device_id=1)
        assert plc.release(4000).temperature_degC == pytest.approx(61.5, abs=0.3)
        asking.client.write_registers(0x1001, [20000], device_id=1)  # beyond the sensor's range
        plc.release(1)
        assert asking.client.read_holding_registers(0x1001, count=1, device_id=1).registers == [615]


def test_a_setpoint_between_two_tenths_is_the_proofs_until_somebody_writes(served, heater):
    words = words_of("omron-e5cc", Scaling(low_degC=0.0, high_degC=333.0))
    plc = served(words, replace(CONDITIONS, setpoint_degC=50.04))
    trace = simulate_words(words, heater, Scenario(setpoint_degC=50.04, duration_s=50.0, noise_degC=0.0))
    told = [plc.release(1) for _ in range(200)]
    np.testing.assert_array_equal([each.power_pct for each in told], trace.power_asked_pct[:200])


def test_registers_between_those_of_an_instrument_are_none(served):
    plc = served(words_of("omron-e5cc"))
    with client(plc, "modbus") as asking:
        for first, count in ((0x2005, 1), (0x2000, 6), (0x2A03, 1), (0, 1)):
            assert asking.client.read_holding_registers(first, count=count, device_id=1).isError(), (first, count)
        assert asking.client.write_registers(0x2A02, [1, 2], device_id=1).isError()
        assert not asking.client.read_holding_registers(0x2A00, count=3, device_id=1).isError()


def test_what_no_protocol_here_reaches_is_told(served):
    with pytest.raises(InputError, match="abb-commander-300 is not among them"):  # it speaks no Modbus
        served(words_of("abb-commander-300"))
    with pytest.raises(InputError, match="--serve s7: weg is reached over modbus alone"):
        served(words_of("weg"), serve="s7")


@pytest.mark.parametrize("target", TARGETS)
def test_without_a_protocol_asked_for_it_is_one_that_reaches_the_controller(served, target):
    plc = served(words_of(target))
    protocol, = plc.addresses
    assert protocol in CLIENTS
    with client(plc, protocol) as asking:
        assert len(asking.read(OWN, 0, OWN_LENGTH)) == OWN_LENGTH
        if protocol == "s7":
            assert len(asking.read(plc.number, 0, plc.length)) == plc.length
            with pytest.raises(FAILED):
                asking.read(plc.number, 0, plc.length + 1)
        else:
            assert isinstance(asking, Modbus)
