"""A cut of the exports of many locales and programs; the others are `long`."""

import pytest

from tests.bench.locale_exports import WRITERS, exports, judge_rows, printed
from tests.bench.messy import REMEDY, RIGHT, STUCK, WRONG

NAMES = [name for name, _, _ in WRITERS]
QUICK = NAMES[::9]


def test_there_are_two_hundred_of_them():
    assert len(NAMES) > 200


@pytest.mark.parametrize("name", QUICK)
def test_an_export_is_read_row_by_row_or_is_a_question_with_an_answer(name):
    (export,) = exports(name)
    found, said = judge_rows(export)
    assert found == RIGHT if not export.user else found in (RIGHT, REMEDY), said


@pytest.mark.long
@pytest.mark.parametrize("kind", sorted({name.partition(":")[0] for name in NAMES}))
def test_every_export_is_read_row_by_row_or_is_a_question_with_an_answer(kind):
    for export in exports():
        if export.tool.startswith(kind) and export.tool not in QUICK:
            found, said = judge_rows(export)
            assert found == RIGHT if not export.user else found in (RIGHT, REMEDY), (export.tool, said)


def test_the_bench_sees_wrong_rows_and_a_refusal():
    (export,) = exports("number: scientific")
    shifted = export.__class__(**{**{name: getattr(export, name) for name in export.__dataclass_fields__},
                                  "content": export.content.replace(b"E+01", b"E+02")})
    assert judge_rows(shifted)[0] == WRONG
    nothing = export.__class__("a photograph", "hostile", "x.png", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 4, export.heater)
    assert judge_rows(nothing)[0] == STUCK
    assert "1 exports: 0 right at once, 0 after its remedy, 0 refused, no way on, 1 WRONG HEATER" in printed([(shifted, WRONG, [])])
