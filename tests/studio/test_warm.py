"""The compiler beside the page: it leaves machine code on disk, and decides how the page's loops run."""

import asyncio
import multiprocessing
import sys
from collections import Counter
from dataclasses import replace

import pytest

from heatertune.compiled import decide, dispatch, worth_compiling
from heatertune.errors import InputError, NotRepresentable
from heatertune.proof import loop
from heatertune.studio import server as warm_up
from heatertune.studio.loop_settings import StudioSettings, first_look, full_proof, optimum

MOST = 10**15


@pytest.fixture(autouse=True)
def undecided(monkeypatch):
    monkeypatch.setattr(dispatch, "_decided", [None])


def beside(monkeypatch, program):
    """Let another program stand for the compiler's; return how loops ran while it ran, and what it was asked for."""
    seen, started = [], asyncio.create_subprocess_exec

    async def start(*asked, **kept):
        seen.append((worth_compiling(MOST), asked))
        return await started(sys.executable, "-c", program, **kept)

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
    return seen


def test_loops_run_plainly_while_the_compiler_works_and_compiled_when_it_is_done(monkeypatch):
    seen = beside(monkeypatch, "")
    asyncio.run(warm_up.warm(("weg", "on-off")))
    assert seen == [(False, (sys.executable, "-m", "heatertune.studio.server", "weg", "on-off"))]
    assert worth_compiling(0)


def test_where_the_compiler_fails_each_loop_is_compiled_where_it_pays(monkeypatch, capfd):
    beside(monkeypatch, "print('told'); raise KeyboardInterrupt")
    asyncio.run(warm_up.warm())
    assert capfd.readouterr() == ("", ""), "what it says is no news to the user"
    monkeypatch.setattr(dispatch, "_scans_asked", Counter())
    monkeypatch.setattr(dispatch, "_PLAIN_SCANS", 50_000)
    assert [worth_compiling(scans) for scans in (49_000, 1_001)] == [False, True]


def test_where_no_program_can_be_started_nothing_is_decided(monkeypatch):
    async def refuse(*_, **__):
        raise OSError("no more processes")

    monkeypatch.setattr(asyncio, "create_subprocess_exec", refuse)
    asyncio.run(warm_up.warm())
    assert dispatch._decided == [None]


def test_without_a_folder_to_keep_it_in_no_compiler_is_started(monkeypatch):
    seen = beside(monkeypatch, "")
    monkeypatch.setattr(warm_up, "folder", lambda: None)
    asyncio.run(warm_up.warm())
    assert seen == []
    assert dispatch._decided == [None]


def test_a_studio_that_ends_ends_the_compiler(monkeypatch):
    running = []

    async def end_early():
        started = asyncio.create_subprocess_exec

        async def start(*_, **__):
            running.append(await started(sys.executable, "-c", "import time; time.sleep(60)"))
            return running[0]

        monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
        task = asyncio.create_task(warm_up.warm())
        while not running:
            await asyncio.sleep(0)
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.wait([task])
        return await running[0].wait()

    assert asyncio.run(end_early()) == -15  # ended by SIGTERM, signal 15 of POSIX


@pytest.mark.long(seconds=12)
def test_what_it_compiles_is_all_that_a_look_and_a_proof_run_and_it_gives_the_same(monkeypatch, heater):
    cores, run = [], loop.run_compiled

    def spied(core, given):
        cores.append(core)
        return run(core, given)

    monkeypatch.setattr(loop, "run_compiled", spied)
    warm_up.compile_all(["s5-ob251", "s7-200-paper"])
    machine_code = {core: loop.compile_function(loop.run_of(core)) for core in cores}
    before = {core: (made.found, made.made) for core, made in machine_code.items()}
    assert len(before) == 3, "the words' loop, the wish's, and the paper's program without its listing, for the proof"
    looked = []
    for way in (True, False):
        decide(way)
        looked.append(first_look(heater, StudioSettings(noise_degC=0.2)))
        assert looked[-1].wish is not None, "run now, in this way"
    machine, plain = looked
    full_proof(heater, machine)
    assert {core: (made.found, made.made) for core, made in machine_code.items()} == before, "nothing compiles later"
    for one, two in ((machine.proof.nominal, plain.proof.nominal), (machine.wish, plain.wish)):
        assert one.temperature_degC.tobytes() == two.temperature_degC.tobytes()


def test_a_controller_that_cannot_hold_an_ordinary_heater_keeps_no_other_from_being_compiled(monkeypatch):
    looked = []

    def look(_, settings):
        looked.append(settings.target)
        if settings.target == "weg":
            raise InputError("too slow")

    monkeypatch.setattr(warm_up, "first_look", look)
    warm_up.compile_all(["weg", "fb41"])
    assert looked == ["weg", "fb41"]


class Unwanted(Exception):
    """Nobody waits for the optimum any more."""


def give_up(_message):
    raise Unwanted


def test_an_optimum_of_the_other_process_is_that_of_this_one_and_ends_where_nobody_waits_for_it(heater):
    searches, settings = warm_up.SearchProcess(), StudioSettings(target="weg", structure="pid", ms=1.537)
    here = optimum(heater, settings)
    try:
        with pytest.raises(Unwanted):  # it begins with the import of the whole program: no answer within a tick
            searches.optimum(heater, replace(settings, ms=1.437), give_up)
        found = searches.optimum(heater, settings, str)
        assert (found.design, found.words, found.search()) == (here.design, here.words, here.search())
        with pytest.raises(NotRepresentable, match="sampling interval TA would be 1e\\+07"):  # as in this process
            searches.optimum(heater, replace(settings, sample_time_s=1e7), str)
    finally:
        processes = multiprocessing.active_children()
        searches.end()
    assert processes
    assert not multiprocessing.active_children()
    # without it the search goes on in this thread
    assert searches.optimum(heater, settings, str).words == here.words


def test_an_optimum_is_found_where_the_other_process_is_killed_or_cannot_be_started(heater, monkeypatch):
    settings = StudioSettings(target="weg", structure="pid", ms=1.537)
    here, searches = optimum(heater, settings), warm_up.SearchProcess()
    searches.begin()
    for process in multiprocessing.active_children():
        process.kill()
    assert searches.optimum(heater, settings, str).words == here.words

    def refuse(*_):
        raise OSError("no more processes")

    for name in ("submit", "__init__"):
        monkeypatch.setattr(warm_up.ProcessPoolExecutor, name, refuse)
        searches = warm_up.SearchProcess()
        searches.begin()
        assert searches.optimum(heater, settings, str).words == here.words
        searches.end()
