"""The page on the loopback address: its start, its address on stdout, and code made ready for the first visitor."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import socket
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, Final

from nicegui import app, background_tasks, ui

from heatertune.cache import folder
from heatertune.compiled import decide
from heatertune.compiled.loader import host
from heatertune.errors import HeatertuneError, InputError
from heatertune.model.model_values import FittedModel, Fopdt, model_by_hand
from heatertune.plc import TARGETS
from heatertune.processors import ProgressCallback, interruptible
from heatertune.studio.access import HOST, Gate, address, new_token
from heatertune.studio.background_work import Work
from heatertune.studio.browser_page import Page
from heatertune.studio.loop_settings import CandidateWords, StudioSettings, first_look, optimum
from heatertune.studio.session import Session, is_printer_log, read_source

__all__ = ["SearchProcess", "compile_all", "serve", "warm"]


_POLL_S: Final = 0.02  # between two questions whether a search has ended
_NICER: Final = 5  # by so much searches give way to the page


#: controllers with the most scans, of which a run that is not compiled takes longest
_LONGEST: Final = ("klipper", "marlin", "weg")


def serve(source: str | None, *, port: int | None, browser: bool) -> None:
    """Serve the studio until it is interrupted.

    Args:
        source: a log file, a built-in table or a folder of `heatertune design` to begin with; None: an empty page.
        port: on 127.0.0.1; None: one that is free.
        browser: whether the page is opened in the user's browser.

    Raises:
        InputError: the source cannot be read, the port is taken.
    """
    sys.setswitchinterval(0.0005)  # [s]: a proof's thread gives way to the page, which needs several turns for a move
    session, searches = Session(), SearchProcess()
    work = Work(session, searches.optimum)
    if source is not None and (not work.load_zones(source) or is_printer_log(source)):
        session.load(read_source(source))  # a printer's heaters are also designed each by itself
    port, token = _free(port), new_token()
    app.add_middleware(Gate, token=token, port=port)
    app.on_startup(lambda: background_tasks.create(_tell(port, token)))
    targets = list(dict.fromkeys([session.settings.target, *_LONGEST, *TARGETS]))
    app.on_startup(lambda: background_tasks.create(warm(targets)))

    app.on_exception(work.fault)
    app.on_shutdown(work.end_recording)
    app.on_shutdown(searches.end)
    app.on_startup(searches.begin)

    def page() -> None:
        Page(work)

    ui.page("/")(page)

    ui.run(
        host=HOST, port=port, show=f"/?token={token}" if browser else False, reload=False, show_welcome_message=False,
        title="heatertune studio", language="en-US", favicon="♨", reconnect_timeout=30.0,
    )


class SearchProcess:
    """A process of its own for the searches of the optimum: in a thread they would hold up every answer of the page."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._newest: Any = context.Value("q", 0, lock=False)  # only this process writes it
        self._pool: ProcessPoolExecutor | None = None
        with suppress(OSError, ImportError, NotImplementedError):  # a machine without semaphores
            self._pool = ProcessPoolExecutor(1, context, _begin_searches, (self._newest,))

    def begin(self) -> None:
        """Start the process before the first search."""
        try:
            if self._pool is not None:
                self._pool.submit(int)
        except OSError:  # no more processes
            self._pool = None

    def end(self) -> None:
        """End the search and the process."""
        self._newest.value += 1
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown(cancel_futures=True)  # and its semaphores are given back with it

    def optimum(self, fitted: FittedModel, settings: StudioSettings, progress: ProgressCallback) -> CandidateWords:
        """Return what `loop_settings.optimum` returns, found in the process, or in this thread where there is none.

        Args:
            fitted: the heater.
            settings: what is asked for.
            progress: called every `_POLL_S`; where it raises, the search ends.

        Raises:
            InputError, NotRepresentable: as `loop_settings.optimum`.
        """
        if (pool := self._pool) is not None:
            self._newest.value = number = self._newest.value + 1
            try:
                future = pool.submit(_numbered_optimum, number, fitted, settings)
                while True:
                    try:
                        return future.result(_POLL_S)
                    except TimeoutError:
                        progress("searching the optimum")
            except (BrokenProcessPool, OSError):
                self._pool = None
            except BaseException:
                self._newest.value += 1
                raise
        return optimum(fitted, settings, progress)


#: in the process of its own: number of the newest request
_request: Final = list[Any]()


class _NewerRequest(Exception):
    """Another optimum is asked for."""


def _begin_searches(newest: Any) -> None:
    """Make a process ready for `_numbered_optimum`; it ends with the one that began it, however that ends."""
    _request.append(newest)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    decide("kept")
    if hasattr(os, "nice"):
        os.nice(_NICER)
    if (parent := multiprocessing.parent_process()) is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    """End this process once another one has ended."""
    parent.join()
    os._exit(0)


def _numbered_optimum(number: int, fitted: FittedModel, settings: StudioSettings) -> CandidateWords:
    def check(_message: str = "") -> None:
        if _request[0].value != number:
            raise _NewerRequest

    with interruptible(check):
        return optimum(fitted, settings, check)


async def _tell(port: int, token: str) -> None:
    """Print the address once somebody answers there."""
    while True:
        try:
            _, writer = await asyncio.open_connection(HOST, port)
        except OSError:
            await asyncio.sleep(0.05)
        else:
            writer.close()
            print(f"heatertune studio: {address(port, token)}", flush=True)
            return


def _free(port: int | None) -> int:
    """Return the port, or a free one; raise InputError where it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port or 0))
        except (OSError, OverflowError) as problem:
            raise InputError(f"--port {port}: cannot be used: {problem}") from problem
        return int(probe.getsockname()[1])


async def warm(targets: Sequence[str] = tuple(TARGETS)) -> None:
    """Compile the loops of controllers beside the page, and let the page run compiled what is there.

    Where nothing can be kept on disk, or the compiler fails, each loop is compiled where it pays, as anywhere else.

    Args:
        targets: the controllers, that in front first.
    """
    if folder() is None:
        return
    decide("kept")
    try:
        quiet = asyncio.subprocess.DEVNULL  # Ctrl-C reaches it too, and its traceback would be no news
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", __name__, *targets, stdout=quiet, stderr=quiet)
        try:
            done = await process.wait() == 0
        finally:
            if process.returncode is None:
                process.terminate()
        if done:
            await asyncio.to_thread(host)  # what loads machine code: no answer shall wait for it
    except OSError:
        done = False
    decide(True if done else None)


def compile_all(targets: Sequence[str]) -> None:
    """Compile the loops that a first look at each controller runs; one that cannot hold an ordinary PI is left out."""
    decide(True)
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0))
    for target in targets:
        try:
            getattr(first_look(heater, StudioSettings(target=target)), "wish", None)  # both loops are run
        except HeatertuneError:
            continue


if __name__ == "__main__":
    compile_all(sys.argv[1:2])
    if hasattr(os, "nice"):
        os.nice(19)
    compile_all(sys.argv[2:])
