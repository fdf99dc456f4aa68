"""The same request gives the same parameters in Python, at the terminal and in the studio."""

import asyncio
import contextlib
import io
import json
import math
import re
from pathlib import Path

import pytest
from tests.conftest import MAIN_JOB

import heatertune as ht
from heatertune.cli import main

README = Path(__file__).parents[2] / "README.md"


@pytest.fixture(scope="module")
def step_log(tmp_path_factory):
    """A step of 0 to 30 % of a heater of 1.2 °C/%, lag 150 s, dead time 12 s, computed here, with a sensor of 0.1 °C."""
    path = tmp_path_factory.mktemp("log") / "zone.csv"
    rows = ["time [s],temperature [degC],power [%]"]
    for k in range(400):
        time_s = 3.0 * k
        rise = 36.0 * (1.0 - math.exp(-max(0.0, time_s - 60.0 - 12.0) / 150.0))
        rows.append(f"{time_s:g},{22.0 + rise:.1f},{30 if time_s >= 60.0 else 0}")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return str(path)


def step_by_step(source, target):
    """Return verdict and words of the step-by-step verbs, as the README's example calls them."""
    model = ht.fit(ht.read_log(source))
    design = ht.tune(model, target=target, structure="pi", ms=1.6)
    words = ht.encode(design, target, model)
    return ht.prove(words, model).verdict, dict(words.values), words.sample_time_s


def in_one_call(source, target, out):
    """Return verdict and words of `ht.design`."""
    proof = ht.design(source, ht.DesignRequest(target=target), out=out).outcome.proof
    return proof.verdict, dict(proof.words.values), proof.words.sample_time_s


def at_the_terminal(*commands, out):
    """Return verdict and words that the last of these commands leaves in a folder."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        for command in commands:
            main([*command, "--quiet"])
    held = json.loads((out / "data" / "words.json").read_text(encoding="utf-8"))
    return held["verdict"], held["words"], held["sample_time_s"]


def in_the_studio(source, target, *, pressed):
    """Return verdict and words beside the download once the page has settled, or a design is asked for."""
    pytest.importorskip("nicegui")
    from heatertune.studio.background_work import Work  # noqa: PLC0415 - likewise
    from heatertune.studio.session import Session  # noqa: PLC0415 - an extra

    work = Work(Session())
    work.session.change(target=target)

    async def story():
        await work.open(source)
        if pressed:
            await work.design()

    asyncio.run(story())
    proof = work.session.front_design().proof
    return proof.verdict, dict(proof.words.values), proof.words.sample_time_s


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize(("log", "target"), [
    ("step", "s5-ob251"), pytest.param("step", "weg", marks=pytest.mark.sample), pytest.param("table4", "fb41", marks=pytest.mark.sample)])
def test_the_same_request_gives_the_same_parameters_everywhere(log, target, step_log, tmp_path):
    source = step_log if log == "step" else log
    model, pid = str(tmp_path / "model.json"), str(tmp_path / "pid.json")
    of = ["--target", target]
    one = in_one_call(source, target, tmp_path / "call")
    assert one[0] != "FAIL"
    assert at_the_terminal(["design", source, *of, "--out", str(tmp_path / "one")], out=tmp_path / "one") == one
    assert in_the_studio(source, target, pressed=True) == one
    plain = step_by_step(source, target)
    assert at_the_terminal(
        ["fit", source, "-o", model], ["tune", model, *of, "-o", pid],
        ["export-db", pid, *of, "-o", str(tmp_path / "steps"), "--force"], out=tmp_path / "steps") == plain
    assert in_the_studio(source, target, pressed=False) == plain
    if plain[0] != "FAIL":  # else `design` changes it, as the verdict of the steps and the studio's offer say
        assert plain == one


@pytest.mark.long(seconds=20)
def test_the_readmes_python_example_shows_the_parameters_of_its_first_command(main_job, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = README.read_text(encoding="utf-8")
    example = re.search(r"## The same in Python\n\n```python\n(.*?)```", text, re.DOTALL)[1]
    exec(compile(example, "README.md", "exec"), {})
    verdict, gain, integral = capsys.readouterr().out.split()[-3:]
    assert re.search(r"heatertune (design table4 .*) --out out/", text)[1].split() == [*MAIN_JOB]
    held = json.loads((main_job[0] / "data" / "words.json").read_text(encoding="utf-8"))
    assert (verdict, int(gain), int(integral)) == (held["verdict"], held["words"]["K"], held["words"]["TI"])
