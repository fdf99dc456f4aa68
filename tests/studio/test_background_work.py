"""One session, its work and the pages that follow it, without a browser."""

import asyncio
import threading
from types import SimpleNamespace

import pytest

from heatertune.errors import ExportRefused, InputError
from heatertune.proof.monte_carlo.run import sample_document
from heatertune.studio import background_work as module
from heatertune.studio import loop_settings as loop
from heatertune.studio.sheet_card import DroppedFile


class Window:
    """A page that writes down what it was shown."""

    def __init__(self, work):
        self.work, self.seen, self.progress, self.drawn = work, [], [], []
        work.follow(self)

    def show(self):
        session = self.work.session
        self.seen.append((session.settings.ms, session.verdict, session.is_computing, session.number))

    def show_move(self):
        self.show()

    def show_loop(self, look):
        self.drawn.append((look.settings.ms, len(self.seen)))

    def show_progress(self):
        self.progress.append(self.work.proving)


def test_what_one_window_moves_every_window_shows_at_once_and_a_closed_one_is_forgotten(work):
    async def story():
        await work.look()
        one, other, closed = Window(work), Window(work), Window(work)
        work.forget(closed)
        work.move(ms=1.4)
        moved = one.seen[-1], other.seen[-1]
        await work.look()
        return moved, one, other, closed

    moved, one, other, closed = asyncio.run(story())
    assert {state[:3] for state in moved} == {(1.4, "proving…", True)}, "before anything was computed"
    assert one.seen == other.seen
    assert one.seen[-1][:3] == (1.4, "PASS", False)
    assert closed.seen == []
    # the S5's manual leaves 6 settings open; each is run at the rated power and at 0.81 and 1.21 of it
    assert any(said.endswith("of 18 runs") for said in one.progress)


def test_no_verdict_is_shown_beside_settings_it_was_not_found_for(work):
    async def story():
        await work.look()
        window = Window(work)
        for ms in (1.6, 1.3, 1.8, 1.5):
            work.move(ms=ms)
            await asyncio.sleep(0)
            background = asyncio.ensure_future(work.look())
        await background
        while work.session.is_computing:
            await asyncio.sleep(0.01)
        return window

    window = asyncio.run(story())
    for _, verdict, computing, _ in window.seen:
        assert computing == (verdict == "proving…")
    assert window.seen[-1][:2] == (1.5, "PASS")


def test_a_slider_that_moves_on_shows_the_loops_on_its_way_each_before_what_is_told_of_it(work, monkeypatch):
    def look_and_move(fitted, settings, gains, *, whole=True):
        if settings.ms != 1.7:
            loops.call_soon_threadsafe(lambda: work.move(ms=round(settings.ms + 0.1, 1)))
        return loop.first_look(fitted, settings, gains, whole=whole)

    async def story():
        nonlocal loops
        loops, window = asyncio.get_running_loop(), Window(work)
        monkeypatch.setattr(module, "first_look", look_and_move)
        work.move(ms=1.5)
        await work.look()
        return window

    loops = None
    window = asyncio.run(story())
    assert [ms for ms, _ in window.drawn] == [1.5, 1.6, 1.7]
    told = next(place for place, state in enumerate(window.seen) if state[:2] == (1.7, "PASS"))
    assert window.drawn[-1][1] <= told, "drawn first"


def test_of_a_long_test_sequence_the_opening_is_drawn_first_and_is_what_the_whole_of_it_begins_with(work, monkeypatch):
    drawn = []
    monkeypatch.setattr(loop, "_QUICK_SCANS", 1000)
    monkeypatch.setattr(Window, "show_loop", lambda _, look: drawn.append(look))

    async def story():
        Window(work)
        work.move(ms=1.5)
        await work.look()

    asyncio.run(story())
    opening, whole, *_ = drawn
    assert [opening.is_opening, whole.is_opening] == [True, False]
    assert opening.gains is whole.gains
    short, long = opening.proof.nominal, whole.proof.nominal
    assert long.time_s[-1] > 5.0 * short.time_s[-1]
    heated = short.time_s < short.scenario.disturbances[0].time_s
    assert heated.sum() > 100
    for name in ("temperature_degC", "power_asked_pct"):
        at = getattr(short, name)[heated], getattr(long, name)[:len(heated)][heated]
        assert at[0] == pytest.approx(at[1], rel=1e-12), "but for the last digit, as marks cut its steps elsewhere"


def test_a_proof_that_nobody_waits_for_ends_with_the_move_and_not_with_the_next_tick(work, monkeypatch):
    begun, given_up, left = threading.Event(), threading.Event(), []

    def prove(fitted, look, tell):
        if look.settings.ms != 1.4:
            return loop.full_proof(fitted, look, tell)
        begun.set()
        try:
            while not given_up.is_set():
                tell("1 of 18 runs")
        finally:
            left.append(look.settings.ms)

    async def story():
        monkeypatch.setattr(module, "full_proof", prove)
        work.move(ms=1.4)
        background = asyncio.ensure_future(work.look())
        await asyncio.to_thread(begun.wait)
        monkeypatch.setattr(module, "_TICK_S", 3600.0)
        await asyncio.sleep(0.02)  # so that it waits for a tick that is an hour away
        work.move(ms=1.6)
        try:
            await asyncio.wait_for(asyncio.gather(background, work.look()), 300.0)
        finally:
            given_up.set()

    asyncio.run(story())
    assert (left, work.session.verdict) == ([1.4], "PASS")


def test_a_download_is_of_the_design_that_stands_beside_its_button_or_refused(work):
    async def story():
        await work.look()
        number = work.session.number
        name, content = await work.zip(number, force=False)
        work.move(ms=1.4)
        with pytest.raises(ExportRefused, match="changed meanwhile"):
            await work.zip(number, force=True)
        with pytest.raises(ExportRefused, match="changed meanwhile"):  # this one is not proven yet
            await work.report(work.session.number, force=True)
        work.move(ms=1.6)
        assert work.session.number == number
        assert await work.zip(number, force=False) == (name, content)

    asyncio.run(story())


def test_drawn_heaters_are_those_of_the_command_line_and_stay_with_their_design(work, monkeypatch):
    monkeypatch.setattr(loop, "DRAWN", 40)

    async def story():
        await work.draw()
        assert work.session.samples is None, "nothing is proven yet"
        await work.look()
        window = Window(work)
        await asyncio.gather(work.draw(), work.draw())
        assert len(window.seen) == 2, "begun and done once"
        seen = work.session.samples
        work.move(ms=1.4)
        assert (work.session.samples, work.can_draw) == (None, False), "before anything was computed"
        await work.look()
        assert (work.session.samples, work.can_draw) == (None, True)
        work.move(ms=1.6)
        await work.look()
        assert work.session.samples is seen
        return seen

    seen = asyncio.run(story())
    front, fitted = work.session.front, work.session.fitted
    assert seen == sample_document(front.gains.words, fitted, 40, front.conditions)


def test_a_fault_while_heaters_are_drawn_is_told_and_can_be_tried_again(work, monkeypatch):
    def fail(*_):
        raise InputError("samples are run without an interlock")

    async def story():
        await work.look()
        monkeypatch.setattr(module, "results_on_samples", fail)
        await work.draw()

    asyncio.run(story())
    assert work.session.fault == "samples are run without an interlock"
    assert (work.session.samples, work.can_draw, work.session.verdict) == (None, True, "PASS")


def test_a_window_that_is_opened_in_the_middle_of_a_fit_sees_how_far_it_is_and_begins_none(work, heater, step_log, monkeypatch):
    begun, go = [], threading.Event()

    def fit(log, tell, known):
        begun.append(log.name)
        tell("tried one model")
        go.wait(10.0)
        return heater

    monkeypatch.setattr(module, "fit_log", fit)
    work.session.fitted = None

    async def story():
        fitting = asyncio.ensure_future(work.take(DroppedFile.of("new.csv", step_log).log, None))
        while not work.busy:
            await asyncio.sleep(0.01)
        window = Window(work)  # the page is loaded again
        await work.go_on()
        window.show()
        assert window.seen[-1][2], "computing"
        assert work.busy.startswith("fitting new")
        go.set()
        await fitting
        return window

    window = asyncio.run(story())
    assert begun == ["new"]
    assert window.seen[-1][:3] == (1.6, "PASS", False)
    assert work.session.log.name == "new"


@pytest.mark.parametrize("broken", ["first_look", "full_proof", "fit_log"])
def test_a_fault_inside_is_told_in_one_sentence_and_logged_and_ends_no_window(work, step_log, monkeypatch, caplog, broken):
    def fail(*_, **__):
        raise ZeroDivisionError("of all things")

    monkeypatch.setattr(module, broken, fail)

    async def story():
        window = Window(work)
        await work.take(DroppedFile.of("new.csv", step_log).log, None) if broken == "fit_log" else await work.look()
        return window

    window = asyncio.run(story())
    told = work.session.error or work.session.file_error
    assert told.startswith("Something went wrong inside heatertune (ZeroDivisionError)")
    assert "restart the studio" in told
    assert "of all things" in caplog.text, "the traceback is on the terminal"
    assert not window.seen[-1][2], "nothing hangs"


def test_a_window_that_cannot_be_drawn_keeps_no_other_from_the_truth(work, caplog):
    class Broken(Window):
        def show(self):
            raise RuntimeError("no such element")

    async def story():
        Broken(work)
        window = Window(work)
        await work.look()
        return window

    assert asyncio.run(story()).seen[-1][1] == "PASS"
    assert "no such element" in caplog.text


@pytest.mark.long
@pytest.mark.parametrize(("target", "button", "price"), [
    ("weg", "Show the nearest design that passes", "with a boost (full power until 8.31 °C from the setpoint"),
])
def test_a_design_that_fails_offers_the_nearest_that_passes_and_goes_back(work, monkeypatch, target, button, price):
    monkeypatch.setattr(module, "_SEEK_S", 0.0)
    session = work.session

    async def story():
        work.move(target=target)
        await work.look()
        assert session.verdict == "FAIL"
        mend, failed = session.suggestion, session.number
        assert mend.button == button
        assert price in mend.message
        assert "--" not in mend.message
        await work.mend()
        assert session.verdict == "PASS"
        assert session.number != failed
        await work.take_back()
        assert (session.verdict, session.number) == ("FAIL", failed)

    asyncio.run(story())


@pytest.mark.long
def test_where_no_limit_within_twice_its_default_would_do_what_helps_at_the_heater_is_told_without_a_button(work, monkeypatch):
    monkeypatch.setattr(module, "_SEEK_S", 0.0)

    async def story():
        work.move(target="on-off")  # swings by 0.6 °C/% · 100 % · 20 s/200 s = 6 °C or so: a tolerance of 5 °C would be asked
        await work.look()

    asyncio.run(story())
    mend = work.session.suggestion
    assert (work.session.verdict, mend.button, mend.changes) == ("FAIL", "", {})
    assert "nothing that was tried passes, nor does any limit of up to twice its default; changes to the heater would help" in mend.message


def test_what_cannot_be_designed_is_told_and_can_be_tried_again(work, monkeypatch):
    tried = []

    def designed(*_):
        tried.append(1)
        raise InputError("no gain keeps the limits")

    monkeypatch.setattr(module, "find_design", designed)

    async def story():
        await work.look()
        await work.design()
        assert work.session.fault == "no gain keeps the limits"
        assert not work.session.is_computing
        await work.design()

    asyncio.run(story())
    assert len(tried) == 2


def test_a_loop_that_is_not_compiled_yet_says_why_the_page_waits(monkeypatch):
    # once the page stayed grey for minutes without a word when klipper was first chosen
    monkeypatch.setattr(module, "_SLOW_S", 0.0)
    work, said = module.Work(module.Session()), []

    async def wait():
        shown = asyncio.Event()

        async def loop():
            await shown.wait()
            return "the loop"

        work.follow(SimpleNamespace(show_progress=lambda: (said.append(work.busy), shown.set())))
        return await work._slowly(loop(), "klipper")

    assert asyncio.run(wait()) == "the loop"
    assert said == ["running klipper, whose loop is not compiled yet…"]
    assert work.busy == ""
