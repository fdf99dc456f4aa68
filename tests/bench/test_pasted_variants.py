"""Words in further ways in which people post them: the numbers of the vendor's document, or a question, never other numbers."""

import tomllib
from collections import Counter
from pathlib import Path

import pytest

from heatertune.errors import HeatertuneError
from heatertune.plc import controller_for
from tests.bench.pasted_words import Pasted, decoded, is_right

CASES = tomllib.loads(Path(__file__).with_name("pasted_variants.toml").read_text(encoding="utf-8"))["case"]


def number(value):
    """Return a number, or the quotient of a pair."""
    return value[0] / value[1] if isinstance(value, list) else value


def pasted(case):
    return Pasted(case["name"], case["target"], case["text"], *(number(case.get(name, 0.0)) for name in ("gain", "tn", "tv")),
                  case.get("ta"), case.get("every"))


def test_there_are_ten_variants_of_each_kind():
    counts = Counter(case["target"].removesuffix("-temp").removesuffix("-compact") for case in CASES)
    assert min(counts.values()) >= 10, counts


@pytest.mark.parametrize("case", CASES, ids=[f"{case['target']}: {case['name']}" for case in CASES])
def test_a_variant_is_read_as_its_document_says_or_is_a_question(case):
    wanted = pasted(case)
    if "ask" in case:
        with pytest.raises(HeatertuneError) as question:
            decoded(wanted)
        assert case["ask"] in str(question.value)
        assert "\n" not in str(question.value)
        if "then" not in case:
            return
    machine, design = decoded(wanted, case.get("then"))
    assert design is None if wanted.gain == "none" else is_right(wanted, machine, design), (machine.words.values, design)
    assert case.get("odd", "") in " ".join(controller_for(case["target"]).oddities(machine.words))
    for told in case.get("assumed", ()):
        assert any(told in each for each in machine.assumed), machine.assumed
