"""Typical mistakes at the terminal: each is refused in one line before anything long begins, with what was meant.

The lines are self-made: misspelled commands, options, controllers, limits, presets and files, units behind numbers, values in the
wrong order, options without the one they need.
"""

import shlex
from contextlib import suppress

import pytest

from heatertune.errors import LONGEST

MISTAKES = [
    ('help desing', "unknown command 'desing': did you mean design?"),
    ('desing table4', "unknown command 'desing': did you mean design?"),
    ('fti table4', "unknown command 'fti': did you mean fit?"),
    ('verfy pid.json', "unknown command 'verfy': did you mean verify?"),
    ('export pid.json', 'did you mean export-db?'),
    ('encode pid.json', 'did you mean export-db?'),  # as the function of Python is called
    ('prove words.json', 'did you mean verify?'),
    ('target', 'did you mean targets?'),
    ('tabel4', 'did you mean heatertune design table4 --target NAME?'),
    ('oven.csv', 'did you mean heatertune design oven.csv --target NAME?'),
    ('design --hlep', 'did you mean --help?'),
    ('--versoin', "unknown option --versoin: did you mean --version?"),
    ('design', 'the following arguments are required: LOG, --target'),
    ('design table4', 'the following arguments are required: --target'),
    ('design --target weg', 'the following arguments are required: LOG'),
    ('design tabel4 --target weg', 'did you mean table4?'),
    ('design table5 --target weg', 'did you mean table4?'),
    ('design TABL3 --target weg', 'did you mean table3?'),
    ('design ovn.csv --target weg', 'did you mean oven.csv?'),
    ('design oven.cvs --target weg', 'did you mean oven.csv?'),
    ('design oven.txt --target weg', 'did you mean oven.csv?'),
    ('design table4 --target s5ob251', "did you mean 's5-ob251'?"),
    ('design table4 --target ob-251', "did you mean 's5-ob251'?"),
    ('design table4 --target s7-20', "did you mean 's7-200'?"),
    ('design table4 --target s7300', "did you mean 's7-300'?"),
    ('design table4 --target kliper', "did you mean 'klipper'?"),
    ('design table4 --target marlyn', "did you mean 'marlin'?"),
    ('design table4 --target eurotherm', "did you mean 'eurotherm-3200'?"),
    ('design table4 --target pidcompact', "did you mean 'pid-compact'?"),
    ('design table4 --target wge', "did you mean 'weg'?"),
    ('design table4 --target PLC', "unknown target 'PLC'"),
    ('design table4 --taget weg', 'did you mean --target?'),
    ('design table4 --target weg --setpont 40', 'did you mean --setpoint?'),
    ('design table4 --target weg --rang 0 100 --setpoin 40 --tolerence 1', 'did you mean --tolerance?'),
    ('design table4 --target weg --setpoint 40C', "'40C' is not a number: write 40, without a unit"),
    ('design table4 --target weg --setpoint 40-50', "'40-50' is not a number: write 40 50"),
    ('design table4 --target weg --setpoint 50 40', 'the lowest first, then the highest'),
    ('design table4 --target weg --setpoint 40 50 60', '--setpoint has 3 values; expected one, or LOW HIGH'),
    ('design table4 --target weg --setpoint -300', '--setpoint = -300.0 is out of range'),
    ('design table4 --target weg --setpoint forty', "'forty' is not a number"),
    ('design table4 --target weg --setpoint 1,000', "'1,000' is not a number: write 1000, or 1.000"),
    ('design table4 --target weg --range 0-200', 'argument --range: expected 2 arguments'),
    ('design table4 --target weg --range 200', 'argument --range: expected 2 arguments'),
    ('design table4 --target weg --range 200 0', 'high_degC = 0.0 is out of range'),
    ('design table4 --target weg --range 0 200°C', "'200°C' is not a number: write 200, without a unit"),
    ('design table4 --target weg --ms 14', '--ms = 14.0 is out of range: must be <= 4'),
    ('design table4 --target weg --ms 0.5', '--ms = 0.5 is out of range: must be > 1'),
    ('design table4 --target weg --ms high', "'high' is not a number"),
    ('design table4 --target weg --structure PDI', 'did you mean pi?'),
    ('design table4 --target weg --structure P+I', "unknown value 'P+I'"),
    ('design table4 --target weg --method simk', "did you mean 'simc'?"),
    ('design table4 --target weg --method ziegler', "did you mean 'ziegler-nichols'?"),
    ('design table4 --target weg --method simc --ms 1.3', 'the rule simc does not look at --ms: leave that out, or leave out --method'),
    ('design table4 --target weg --method lambda --mt 1.2 --objective iae', 'does not look at --objective and --mt'),
    ('tune --gain 0.4 --time-constant 167 --dead-time 12 --method simc --ms 1.3', 'does not look at --ms'),
    ('design table4 --target weg --out oven.csv/new', '--out oven.csv/new: '),
    ('design https://example.org/log.csv --target weg', 'an address; expected a file: download it first'),
    ('design table4 --target weg --method simc --robust p95', 'has no limits to keep'),
    ('design table4 --target weg --objective iaee', 'did you mean iae?'),
    ('design table4 --target weg --robust p99', 'did you mean p95?'),
    ('design table4 --target weg --sample-time 1s', "--sample-time is '1s'; expected seconds, auto or words"),
    ('design table4 --target weg --sample-time atuo', 'did you mean auto?'),
    ('design table4 --target weg --sample-time -1', '--sample-time = -1.0 is out of range'),
    ('design table4 --target weg --limit overshot=3degC', "did you mean 'overshoot'?"),
    ('design table4 --target weg --limit overshoot', 'expected NAME=VALUE'),
    ('design table4 --target weg --limit overshoot=three', 'expected a number with its unit'),
    ('design table4 --target weg --limit overshoot=3kelvin', "with the unit 'kelvin'"),
    ('design table4 --target weg --limit', 'expected one argument'),
    ('design table4 --target weg --limit setling=600s', "did you mean 'settling'?"),
    ('design table4 --target weg --spec ovn', "did you mean 'oven'?"),
    ('design table4 --target weg --spec Kiln.toml', 'Kiln.toml'),
    ('design table4 --target weg --spec oven.tml', "did you mean 'oven'?"),
    ('design table4 --target weg --profile firing.cvs', 'firing.cvs: cannot be read'),
    ('design table4 --target weg --accept unit-asumed', "did you mean 'unit-assumed'?"),
    ('design table4 --target weg --accept everything', "unknown finding to accept 'everything'"),
    ('design table4 --target weg --assume antiwindup=x', "did you mean 'anti_windup'?"),
    ('design table4 --target weg --assume filter=implcit', "did you mean 'implicit'?"),
    ('design table4 --target weg --assume filter', 'expected NAME=SETTING'),
    ('design table4 --target weg --switch-kind triac', "unknown value 'triac'"),
    ('design table4 --target weg --switch-kind contacter', 'did you mean contactor?'),
    ('design table4 --target weg --pwm-period 2s', "'2s' is not a number: write 2, without a unit"),
    ('design table4 --target weg --pwm-period 0', '--pwm-period = 0.0 is out of range'),
    ('design table4 --target weg --minimum-on 1', 'need --pwm-period'),
    ('design table4 --target weg --pwm-rule pulse', 'did you mean pulsegen?'),
    ('design table4 --target weg --boost yes', "unknown value 'yes' (expected auto or none)"),
    ('design table4 --target weg --setpoint-ramp fast', 'expected °C/min, auto or none'),
    ('design table4 --target s7-300 --input 4-20', 'did you mean 4-20mA?'),
    ('design table4 --target s7-300 --input pt100', 'expected 4-20mA, thermocouple, rtd or rtd-climatic'),
    ('design table4 --target weg --noise -1', '--noise = -1.0 is out of range'),
    ('design table4 --target weg --samples ten', "'ten' is not a whole number"),
    ('design table4 --target weg --samples 0', '--samples = 0 is out of range'),
    ('design table4 --target weg --samples 1e3', "'1e3' is not a whole number"),
    ('design table4 --target weg --interlock fan', 'expected heater-fan'),
    ('design table4 --target weg --limit-temperature 60', 'need --interlock'),
    ('design table4 --target weg --ambient 22C', 'write 22, without a unit'),
    ('design table4 --target weg --temperature-unit F', 'expected degC, degF, K'),
    ('design table4 --target weg --temperature-unit dgeF', 'did you mean degF?'),
    ('design table4 --target weg --time-unit sec', 'expected s, ms, us, ns, min, h, d'),
    ('design table4 --target weg --power-full-scale 100%', 'write 100, without a unit'),
    ('design oven.csv --target weg --temperature-column temp', "no temperature column 'temp'"),
    ('design oven.csv --target weg --power-column powr', "no power column 'powr'"),
    ('design table4 --target weg --out oven.csv', '--out oven.csv: a file; expected a folder'),
    ('design firing.csv --target weg --out x --read', 'unknown option --read'),
    ('design table4 table3 --target weg', 'unrecognized arguments: table3'),
    ('design table4 --target weg --spread 5', 'for zones designed together; name them with --zones'),
    ('design table4 --target weg --stagger', '--stagger: for zones designed together'),
    ('design table4 --target weg --peak-power 0', '--peak-power: for zones designed together'),
    ('design table4 --target weg --zone-log rear.csv', '--zone-log: for zones designed together'),
    ('design table4 --target weg --zones front rear', 'write a list as one word, --zones a,b'),
    ('design table4 --target weg -v', 'unrecognized arguments: -v'),
    ('fit ovn.csv', 'did you mean oven.csv?'),
    ('read table33', 'did you mean table3?'),
    ('verify words.jsn', 'cannot be read'),
    ('tune --gain 0.37 --time-constant 167', 'no model: name a model file, or add --dead-time'),
    ('tune --gain 0.37 --time-constant 167 --dead-time 12 --zero 60', 'state that of the fast element'),
    ('tune --gain 0.37 --time-constant 167 --second-time-constant 20 --dead-time 12 --zero 170', 'between both time constants'),
    ('tune --gian 0.37', 'did you mean --gain?'),
    ('tune oven.csv --target weg', 'oven.csv'),
    ('spec ovn', "did you mean 'oven'?"),
    ('spec oven --limit overshot=1', "did you mean 'overshoot'?"),
    ('terms hold-bak', 'did you mean holdback'),
    ('decode dump.bin', 'the following arguments are required: --target'),
    ('fleet nothing --target weg -o out.csv', 'nothing: cannot be read'),
    ('completion bahs', 'did you mean bash?'),
]
RIGHT = [
    'design table4 --target S7-1500 --setpoint 53,3',
    'design table4 --target ob251 --range 0 200,5 --ms 1,4',
    'design table4 --target weg --structure PID --method SIMC',
    'design table4 --target weg --objective IAE --switch-kind SSR',
    'design oven.csv --target weg --tolerance 1,5 --limit overshoot=3degC',
    'design table4 --target pid_compact --sample-time 1,5',
    'tune --gain 0,37 --time-constant 167 --dead-time 12 --ambient -5,5',
    'tune --gain 0,37 --time-constant 167 --second-time-constant 20 --zero 60 --dead-time 12',
]


class LongStepError(Exception):
    """Something long has begun."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with a few files, in which nothing long may begin."""
    (tmp_path / "oven.csv").write_text("time_s,temp_C,power_pct\n" + "".join(f"{5 * i},{20 + i * 0.1:.2f},50\n" for i in range(60)), encoding="utf-8")
    (tmp_path / "firing.csv").write_text("target [degC],ramp [degC/h],soak [min]\n35,60,20\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HEATERTUNE_DEBUG", "1")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))

    def begin(*_, **__):
        raise LongStepError

    for name in ("cache.load_or_compute", "model.fit.fit", "pid.tune.tune", "proof.proof.prove_models", "plc.design.tune_model"):
        monkeypatch.setattr(f"heatertune.{name}", begin, raising=False)
    monkeypatch.setattr("heatertune.chain.precompile._begun", lambda: None)


def test_there_are_a_hundred():
    assert len({line for line, _ in MISTAKES}) == len(MISTAKES) >= 100


@pytest.mark.parametrize(("line", "message"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_is_refused_in_one_line_with_what_was_meant_before_anything_long(line, message, run, tmp_path):
    there = sorted(tmp_path.iterdir())
    status, _, err = run(*shlex.split(line))
    error = err.splitlines()[-1]
    assert status == 2
    assert error.startswith("error: ")
    assert message in error
    assert len(error) <= LONGEST + 80
    assert sorted(tmp_path.iterdir()) == there


@pytest.mark.parametrize("command", ["read", "fit", "validate", "tune", "verify", "decode --target weg", "compare", "report", "write"])
@pytest.mark.parametrize("name", ["a" * 5000, "x\0/y", "a/" * 3000])
def test_a_name_that_no_file_can_have_is_refused_as_any_other(command, name, run):
    status, _, err = run(*command.split(), name)
    assert status == 2
    assert len(err.splitlines()) == 1


def test_a_comparison_with_a_name_too_long_is_refused(run):
    status, _, err = run("diff", "a" * 5000, "b" * 5000)
    assert status == 2
    assert "cannot be read: File name too long" in err


@pytest.mark.parametrize("line", RIGHT)
def test_what_is_meant_without_doubt_is_taken(line, run):
    with pytest.raises(LongStepError):
        run(*shlex.split(line))


@pytest.mark.parametrize(("line", "shown"), [
    (("help",), "usage: heatertune"), (("help", "design"), "the options that matter most"), (("help", "design", "all"), "reading the log"),
    (("completion", "man"), ".TH HEATERTUNE 1"),
])
def test_help_is_a_command_too_and_there_is_a_man_page(line, shown, run, capsys):
    with suppress(SystemExit):
        print(run(*line)[1])
    assert shown in capsys.readouterr().out


def test_the_users_file_states_options_that_a_line_leaves_out_and_says_so(run, tmp_path):
    (tmp_path / "heatertune.toml").write_text('target = "ob251"\nrange = [0, 200]\npwm-period = 2\n', encoding="utf-8")
    status, _, err = run("design", "table4", "--ms", "14")
    assert status == 2
    assert err.splitlines() == [
        "[heatertune.toml] --target ob251 --range 0 200 --pwm-period 2", "error: --ms = 14.0 is out of range: must be <= 4"]
    status, _, err = run("design", "oven.csv", "--targ=weg", "--temperature-column", "x")
    assert "[heatertune.toml] --range 0 200 --pwm-period 2\n" in err
    assert "--target" not in err
    status, _, err = run("verify", "none.json")
    assert "heatertune.toml" not in err  # what a file records is not changed


@pytest.mark.parametrize(("content", "message"), [
    ("targt = 'weg'\n", "heatertune.toml: targt: no such key: did you mean target?"), ("target = true\n", "expected a text, a number"),
    ("target =\n", "heatertune.toml"), ("target = 'wge'\n", "did you mean 'weg'?"),
    ("target = 5\n", "heatertune.toml] --target 5"), ("range = ['low', 'high']\n", "heatertune.toml] --range low high"),
])
def test_a_users_file_that_says_what_no_option_has_is_refused(content, message, run, tmp_path):
    (tmp_path / "config" / "heatertune").mkdir(parents=True)
    (tmp_path / "config" / "heatertune" / "heatertune.toml").write_text(content, encoding="utf-8")
    status, _, err = run("design", "table4")
    assert status == 2
    assert message in err


def test_a_folder_that_is_no_design_is_not_written_into_unasked(run, tmp_path):
    (tmp_path / "oven").mkdir()
    status, _, err = run("design", "oven.csv", "--target", "weg")
    assert (status, err) == (2, "error: oven: there already, and no design: name a folder with --out\n")


def test_the_folder_of_a_design_is_verified_by_its_parameters(run, tmp_path):
    (tmp_path / "oven" / "data").mkdir(parents=True)
    (tmp_path / "oven" / "data" / "words.json").write_text('{"schema": "heatertune/words/2"}', encoding="utf-8")
    assert run("verify", "oven")[::2] == (2, "error: oven/data/words.json: target: is missing\n")
