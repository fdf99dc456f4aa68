"""No option of the command line appears on the page."""

import ast
import re
from pathlib import Path
from unittest import mock

import pytest

import heatertune
from heatertune.proof.design_request import DesignResult
from heatertune.studio.loop_settings import StudioSettings
from heatertune.studio.wording import for_page, mend_for

OPTION = re.compile(r"--[a-z]")
#: folders and modules whose sentences no page of the studio shows
ELSEWHERE = ("cli", "batch", "bench.py", "doctor.py", "settings.py", "html.py")


def sentences():
    """Every text of the package that names an option, but for docstrings."""
    for path in sorted(Path(heatertune.__file__).parent.rglob("*.py")):
        if set(ELSEWHERE) & {path.name, path.parent.name}:
            continue
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text if OPTION.search(text) else "")
        told = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in told and OPTION.search(node.value):
                yield node.value


def test_no_sentence_of_the_chain_names_an_option_once_it_is_on_the_page():
    found = list(sentences())
    assert len(found) > 60
    for sentence in found:
        assert not OPTION.search(for_page(sentence)), sentence


@pytest.mark.parametrize(("told", "shown"), [
    ("expected --temperature-unit degC, degF or K", "expected the temperature's unit: degC, degF or K"),
    ("expected --time-column NAME or N", "expected ‘time column’"),
    ("0…1 (--power-full-scale tells another reading at full power)", "0…1 (or another reading at full power)"),
    ("expected another --power-tag, or --power-tag none", "expected another ‘power tag’, or no power chosen"),
    ("the log shows no dead time; log finer, or --accept dead-time; more", "the log shows no dead time; log finer; more"),
    ("--tag A --tag-column line to read one of them", "the role zone for ‘line’ to read one of them"),
    ("a file --x-- and '---' stay, 3--4 too", "a file ‘x’-- and '---' stay, 3--4 too"),
])
def test_a_sentence_stays_one(told, shown):
    assert for_page(told) == shown


@pytest.mark.parametrize(("options", "shown", "changes"), [
    (("--switch-kind", "ssr", "--pwm-period", "2.5"), "with a solid-state relay and a PWM period of 2.5 s",
     {"switch_kind": "ssr", "pwm_period_s": 2.5}),
    (("--switch-kind", "ssr"), "with a solid-state relay", {"switch_kind": "ssr"}),
    (("--pwm-period", "0.5"), "at a PWM period of 0.5 s", {"pwm_period_s": 0.5}),
])
def test_a_switch_and_its_period_that_would_pass_are_one_click(options, shown, changes):
    failed = mock.Mock(spec=DesignResult, notes=[f"It fails: overshoot; would pass at {' '.join(options)}"], passes_with=options)
    failed.proof.verdict = "FAIL"
    offer = mend_for(failed, StudioSettings())
    assert (offer.message, offer.changes, offer.button) == (f"It fails: overshoot; would pass {shown}.", changes, "Ask for that")
