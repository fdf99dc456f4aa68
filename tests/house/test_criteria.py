"""A criterion is declared in one file: a trial criterion there is known to all that read the table, and nothing else is touched."""

import ast
import json
import os
import shutil
import subprocess
import sys

from tests.conftest import ROOT

from heatertune.proof.criteria import CRITERIA, CRITERION, LIMITS, LoopLimits

SOURCE = ROOT / "src" / "heatertune"
TABLE = "proof/criteria.py"

#: what the trial adds to the table: a field, the limit that users write, and the criterion
FIELD = "    peak_degC: float | None = field(default=None, metadata=LEFT_OUT)\n"
LIMIT = '    "peak": Limit('
ROW = '    CriterionKind(name="peak"'
TRIAL = {
    FIELD: f"    rest_distance_degC: float | None = field(default=None, metadata=LEFT_OUT)\n{FIELD}",
    LIMIT: '    "rest-distance": Limit(description="largest distance from the setpoint at rest", example="3 degC",\n'
           f'                           units={{"degC": Measure("rest_distance_degC")}}),\n{LIMIT}',
    ROW: '    CriterionKind(name="rest_distance", unit="°C", description="Largest distance from the setpoint at rest.",\n'
         '                  measure=off_at_rest_degC, phases=_HELD, at_rest=True, limit="rest_distance_degC", label="distance at rest",\n'
         f'                  column="rest_distance_degC", remedies=(_SWITCH,), not_in_trace="a trial"),\n{ROW}',
}

#: proves PI parameters with a limit for the trial criterion, and prints what the readers of the table say of it
SCRIPT = """
import json
from heatertune.batch.fleets import RESULT
from heatertune.model.model_values import Fopdt
from heatertune.pid.sampled_loop import margins
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.proof import Acceptance, Actuator, Scenario, prove_models
from heatertune.proof.proof_document import check_document
from heatertune.proof.nearest_specification import limits_above, physical_help
from heatertune.proof.specification import in_force, spec_text
from heatertune.report.verdict_summary import verify_brief

design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi", method="")
heater = Fopdt(gain_degC_per_pct=0.5, time_constant_s=60.0, dead_time_s=3.0, ambient_degC=20.0)
controller, spec = controller_for("s5-ob251"), in_force(None, ["rest-distance=0.001degC"])
proof = prove_models(controller, controller.encode(design, Scaling()), [("heater", heater)], Scenario(setpoint_degC=40.0, duration_s=600.0),
                     Actuator(pwm_period_s=1.0), Acceptance(limits=spec.limits_for(63.0), margins_of=margins, specification=spec))
document = check_document(json.loads(json.dumps(proof.to_document())), "proof.json")
print(json.dumps({
    "criterion": document["criteria"]["rest_distance"], "limit": document["limits"]["rest_distance_degC"], "spec": spec_text(spec),
    "brief": verify_brief(document), "columns": [column.name for column in RESULT],
    "nearest": limits_above(each for each in proof.criteria if each.name == "rest_distance"),
    "help": physical_help(["rest_distance"])}))
"""


def test_a_criterion_is_added_in_one_file(tmp_path):
    copied = tmp_path / "heatertune"
    shutil.copytree(SOURCE, copied, ignore=shutil.ignore_patterns("__pycache__"))
    text = (copied / TABLE).read_text(encoding="utf-8")
    for place, added in TRIAL.items():
        assert text.count(place) == 1
        text = text.replace(place, added)
    (copied / TABLE).write_text(text, encoding="utf-8")
    run = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False,
                         env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert run.returncode == 0, run.stderr
    known = json.loads(run.stdout)
    assert known["limit"] == 0.001
    assert not known["criterion"]["ok"], "nothing rests within a thousandth of a degree of a reading of 0.1 °C"
    assert 'rest-distance = "0.001degC"' in known["spec"]
    assert "distance at rest" in known["brief"]
    assert "rest_distance_degC" in known["columns"]
    assert [*known["nearest"]] == ["rest-distance"]
    assert known["help"].startswith("a faster switch")


def test_no_other_file_lists_the_criteria():
    # these choose the figures of a screen
    choice = {"proof/advice.py", "proof/comparison.py"}
    for path in sorted(SOURCE.rglob("*.py")):
        if (file := path.relative_to(SOURCE).as_posix()) in {TABLE, *choice}:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Tuple | ast.List | ast.Set | ast.Dict):
                parts = [*node.keys, *node.values] if isinstance(node, ast.Dict) else node.elts
                listed = {part.value for part in parts if isinstance(part, ast.Constant) and part.value in CRITERION}
                assert len(listed) <= 3, (file, node.lineno, listed)


def test_every_limit_of_a_criterion_is_a_field_that_users_can_set():
    fields = {measure.field for limit in LIMITS.values() for measure in limit.units.values()}
    assert {kind.limit for kind in CRITERIA if kind.limit} - {"overflows"} <= fields  # no flag of an overflow is ever right
    assert fields <= {*LoopLimits.__dataclass_fields__}
    assert len(CRITERION) == len(CRITERIA)
    columns = [kind.column for kind in CRITERIA if kind.column]
    assert len({*columns}) == len(columns)
