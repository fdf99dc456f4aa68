"""The data blocks that the virtual PLC serves of the S7-300, against those of the exported source in awlsim."""

from tests.golden.test_fb41 import INTERFACE, OUTPUTS
from tests.live.conftest import words_of

from heatertune.live.controller_block import block_for
from heatertune.live.siemens_blocks import COMPACT_PLACES as PLACES
from heatertune.live.siemens_blocks import CONT_C_LAYOUT as CONT_C
from heatertune.live.siemens_blocks import CONT_C_SETPOINT as SETPOINT
from heatertune.plc import Certificate, controller_for

#: what the block keeps, in the order and by the names of public re-implementations of it
STATICS = [("sInvAlt", "REAL"), ("sIanteilAlt", "REAL"), ("sRestInt", "REAL"), ("sRestDif", "REAL"), ("sRueck", "REAL"), ("sLmn", "REAL"),
           ("sbArwHLmOn", "BOOL"), ("sbArwLLmOn", "BOOL"), ("sbILimOn", "BOOL")]
#: the same → the field of the step's state
FIELDS = {"sInvAlt": "before", "sIanteilAlt": "integral", "sRestInt": "integral_rest", "sRestDif": "feedback_rest", "sRueck": "feedback",
          "sLmn": "limited", "sbArwHLmOn": "at_upper", "sbArwLLmOn": "at_lower", "LMN": "output", "LMN_D": "derivative"}


def test_each_call_leaves_the_served_block_of_the_tip_as_the_exported_program_leaves_its_own(awlsim):
    controller, words = controller_for("s7-300"), words_of("s7-300")
    block = block_for(controller, words, {})
    cells, state, served, rows = bytearray(block.image()), block.begin(), [], []
    readings = [5000 + 37 * number % 900 for number in range(40)] + [20000, 27648, 0, 13824, 13000]
    for number, reading in enumerate(readings):
        setpoint = 13824 if number < 30 else 9000
        state, *_ = block.scan(cells, state, setpoint, reading)
        served.append(bytes(cells).hex())
        rows.append([1, setpoint, reading, None])
    answer = awlsim(controller.export(words, Certificate(verdict="PASS"))["s7_300_pid.awl"], rows)
    assert answer["rows"] == served


def _section(kind, members, end="END_VAR"):
    return [kind, *(f"  {name} : {type_} ;" for name, type_ in members), end]


def _offsets(machine, number, *lines):
    """Where awlsim puts the members of a data block of this source."""
    machine.load("\r\n".join(lines) + "\r\n")
    return {name: (byte, bit) for name, (byte, bit, _) in machine.names(number).items()}


def test_the_cells_of_cont_c_stand_where_the_types_of_its_interface_put_them(machine):
    offsets = _offsets(
        machine, 41, "FUNCTION_BLOCK FB 41", "VERSION : 0.1", *_section("VAR_INPUT", INTERFACE), *_section("VAR_OUTPUT", OUTPUTS),
        *_section("VAR", STATICS), "BEGIN", "NETWORK", "      NOP   0;", "END_FUNCTION_BLOCK",
        "DATA_BLOCK DB 41", "FB 41", "BEGIN", "END_DATA_BLOCK")
    state = {name: CONT_C.state[field] for name, field in FIELDS.items()}
    known = {**CONT_C.words, **CONT_C.inputs, **state, "SP_INT": SETPOINT}
    assert {name: (place.byte, place.bit) for name, place in known.items()} == {name: offsets[name] for name in known}
    assert set(CONT_C.state.values()) == set(state.values())
    assert CONT_C.length == offsets["sbILimOn"][0] + 2  # a block ends at a whole word


def test_the_block_beside_pid_compact_is_laid_out_as_step_7_lays_out_its_members(machine):
    members = [(name, place.format) for name, place in PLACES.items()]
    offsets = _offsets(machine, 1, "DATA_BLOCK DB 1", *_section("STRUCT", members, "END_STRUCT ;"), "BEGIN", "END_DATA_BLOCK")
    assert {name: (place.byte, place.bit) for name, place in PLACES.items()} == offsets
