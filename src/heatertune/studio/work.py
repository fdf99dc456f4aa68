"""What takes long, beside the pages: fits, loops, proofs and searches in threads, the newest wish first.

There is one for the session, whatever windows are open: it goes on while a page is loaded again, and tells every page
what changed.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any, Final, Protocol

from heatertune.commissioned import AsLeftSettings
from heatertune.errors import HeatertuneError
from heatertune.log.values import Log
from heatertune.progress import ProgressCallback
from heatertune.settings import FitSettings
from heatertune.studio.as_left_session import held_against
from heatertune.studio.downloads import export_zip, report_page
from heatertune.studio.live_log import LiveLog, RecordingRequest
from heatertune.studio.loop import DRAWN, LoopView, find_design, first_look, full_proof, on_drawn_heaters, optimum
from heatertune.studio.session import Session, Ticket
from heatertune.studio.sources import fit_log, read_source
from heatertune.studio.views import export_name
from heatertune.studio.wording import fault_told, for_page

__all__ = ["Follower", "Work"]

_REST_S: Final = 0.15  # a slider that moves on within this time wants no proof yet
_SEEK_S: Final = 1.0  # who looks at a FAIL for so long may want to know what would pass
_TICK_S: Final = 0.1
_LIVE_S: Final = 0.5  # between two pictures of a loop that is being recorded

_log: Final = logging.getLogger(__name__)


class Follower(Protocol):
    """A page."""

    def show(self) -> object:
        """Show the session as it is now."""

    def show_progress(self) -> object:
        """Show how far the work is."""

    def show_live(self) -> object:
        """Show the loop that is being recorded."""


class _ResultNotNeeded(Exception):
    """Nobody wants the result any more."""


class Work:
    """The work of a session.

    Args:
        session: what is worked on; touched in the event loop's thread only.

    Attributes:
        busy: what takes long and how far it is, a few words; "" where nothing does.
        proving: how far the proof of the design in front is, as "18 of 54 runs"; "" before it begins.
        live: the loop that is being recorded, or was; None: none.
        live_error: why it is not, one line; "" where it is.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.busy = self.proving = self.live_error = ""
        self.live: LiveLog | None = None
        self._recording: asyncio.Task[None] | None = None
        self._pages: list[Follower] = []
        self._fitting = self._looking = self._proving = self._seeking = self._drawing = False
        self._moved_at = 0.0
        self._held = 0

    def follow(self, page: Follower) -> None:
        """Tell a page from now on what changes."""
        self._pages.append(page)

    def forget(self, page: Follower) -> None:
        """Tell a page no more: it is closed."""
        self._pages = [other for other in self._pages if other is not page]

    def tell(self) -> None:
        """Let every page show the session as it is now."""
        self._each(lambda page: page.show())

    def _each(self, show: Callable[[Follower], object]) -> None:
        for page in self._pages:
            try:
                show(page)
            except Exception:  # one page that cannot be drawn keeps no other from the truth
                _log.exception("a page could not be drawn")

    def fault(self, problem: Exception) -> str:
        """Tell on every page that something went wrong inside, its traceback on stderr; return the sentence."""
        _log.error("unexpected fault", exc_info=problem)
        self.session.fault = fault_told(problem)
        self.tell()
        return self.session.fault

    async def go_on(self) -> None:
        """Fit a log that waits and is not being fitted, else show the loop of the settings."""
        session = self.session
        if session.fitted is None and session.coming is not None:
            if not self._fitting:
                await self._fit(session.coming, session.known)
        else:
            await self.look()

    async def open(self, source: str) -> None:
        """Read a path or built-in table and fit it."""
        try:
            log = (await asyncio.to_thread(read_source, source)).log
        except HeatertuneError as problem:
            self.session.refuse_file(problem)
            self.tell()
            return
        await self._fit(log)

    async def take(self, log: Log, known: FitSettings) -> None:
        """Fit a log with what is known beside it."""
        await self._fit(log, known)

    async def _fit(self, log: Log, known: FitSettings | None = None) -> None:
        session = self.session
        ticket, self._fitting = session.begin(log, known), True
        self.tell()

        def run(tell: ProgressCallback) -> Any:
            return fit_log(log, tell, known)

        try:
            fitted = await self._told(run, f"fitting {log.name}", lambda: session.is_coming(ticket))
        except _ResultNotNeeded:
            return
        except Exception as problem:
            session.fit_refused(ticket, self._kind(problem))
        else:
            session.fit_done(ticket, fitted)
        finally:
            self._fitting = session.coming is not None  # another one came meanwhile, and is being fitted
        self.tell()
        await self.look()

    def move(self, **fields: Any) -> None:
        """Move settings, on every page at once; `look` shows their loop."""
        self.session.change(**fields)
        self.proving = ""
        self.tell()

    async def look(self) -> None:
        """Show the loop of the settings; while one is computed, only the newest settings wait."""
        self._moved_at = time.monotonic()
        session = self.session
        if self._looking or session.fitted is None:
            return
        self._looking = True
        try:
            while not session.known_look():
                ticket, fitted, settings, gains = session.ticket, session.fitted, session.settings, session.gains()
                try:
                    session.look_done(ticket, await asyncio.to_thread(first_look, fitted, settings, gains))
                except Exception as problem:
                    if session.look_refused(ticket, self._kind(problem)):
                        break
        finally:
            self._looking = False
        self.tell()
        await self._prove()
        await self._seek()

    async def _prove(self) -> None:
        """Prove what waits, one at a time, once the sliders rest; what nobody waits for any more is left."""
        if self._proving:
            return
        self._proving, session = True, self.session
        try:
            while session.unproven():
                await asyncio.sleep(max(0.0, self._moved_at + _REST_S - time.monotonic()))
                if time.monotonic() < self._moved_at + _REST_S or not (waiting := session.unproven()):
                    continue
                ticket, look = waiting[0]
                fitted, self.proving = session.fitted, ""
                if session.is_quick(ticket):
                    await self._optimise(ticket, look)
                    continue

                def run(tell: ProgressCallback) -> Any:
                    return full_proof(fitted, look, tell)  # type: ignore[arg-type]  # noqa: B023 - runs before the next

                try:
                    proof = await self._told(run, "", lambda: ticket in dict(session.unproven()))  # noqa: B023 - as run
                    session.proof_done(ticket, proof)
                except _ResultNotNeeded:
                    continue
                except Exception as problem:
                    session.proof_refused(ticket, self._kind(problem))
                self.tell()
        finally:
            self._proving = False

    async def _optimise(self, ticket: Ticket, look: LoopView) -> None:
        """Put the optimum with which `heatertune design` begins in the place of a quick design."""
        session, fitted = self.session, self.session.fitted

        def run(tell: ProgressCallback) -> LoopView:
            gains = optimum(fitted, look.settings, tell)  # type: ignore[arg-type]  # there is a look, so a heater
            return first_look(fitted, look.settings, gains)  # type: ignore[arg-type]  # likewise

        try:
            session.optimum_done(ticket, await self._told(run, "", lambda: ticket in dict(session.unproven())))
        except _ResultNotNeeded:
            return
        except Exception as problem:
            session.proof_refused(ticket, self._kind(problem))
        self.tell()

    async def design(self) -> None:
        """Show what `heatertune design` finds for the settings, as soon as it is found."""
        self.session.take()
        self.tell()
        await self.look()

    async def mend(self) -> None:
        """Show what would pass in place of the design in front."""
        mend = self.session.suggestion
        if mend is not None:
            self.session.allow(mend.changes)
            await self.design()

    async def take_back(self) -> None:
        """Show what was there before a design was taken."""
        self.session.take_back()
        self.tell()
        await self.look()

    async def _seek(self) -> None:
        """Look for a design that passes where the one in front fails, or where the user asked for it."""
        if self._seeking:
            return
        self._seeking, session = True, self.session
        try:
            while session.is_searching:
                key, fitted, settings, awaited = session.key, session.fitted, session.settings, session.is_awaited
                if not awaited and time.monotonic() < self._moved_at + _SEEK_S:
                    await asyncio.sleep(_TICK_S)
                    continue

                def run(tell: ProgressCallback) -> Any:
                    return find_design(fitted, settings, tell)  # type: ignore[arg-type]  # noqa: B023 - runs before the next

                try:
                    what = "searching the design" if awaited else "looking for what would pass"
                    session.take_design(key, await self._told(run, what, lambda: key == session.key))  # noqa: B023 - as run
                except _ResultNotNeeded:
                    continue
                except Exception as problem:
                    session.take_design(key, None)
                    kind = self._kind(problem)
                    if key == session.key and awaited:
                        session.fault = str(kind)
                if session.has_design:
                    await self.look()
                self.tell()
        finally:
            self._seeking = False

    async def hold(self, log: Log, about: AsLeftSettings, number: int) -> None:
        """Hold a trace of the commissioned loop against the design that bears a number, or tell why that cannot be.

        Args:
            log: the trace; where another one comes meanwhile, that counts.
            about: what is known beside it.
            number: of the design as the page showed it.
        """
        session = self.session
        session.file_error = session.fault = ""
        self._held += 1
        newest = self._held
        try:
            standing, ticket = session.front_design(number), session.ticket
            left = await self._told(lambda tell: held_against(standing, log, about, tell),
                                    f"holding {log.name} against the proof", lambda: newest == self._held)
        except _ResultNotNeeded:
            return
        except Exception as problem:
            session.refuse_file(self._kind(problem))
        else:
            session.left_done(ticket, standing.proof, left)
        self.tell()

    async def draw(self) -> None:
        """Run the proven design in front on drawn heaters; what it shows stays with that design."""
        if not self.can_draw:
            return
        proven, ticket, what = self.session.front_design(), self.session.ticket, f"running {DRAWN:,} drawn heaters"
        self._drawing, self.session.fault = True, ""
        self.tell()
        try:
            samples = await self._told(lambda _: on_drawn_heaters(proven.fitted, proven.look), what, lambda: True)
            self.session.drawn_done(ticket, proven.proof, samples)
        except Exception as problem:
            self.session.fault = str(self._kind(problem))
        finally:
            self._drawing = False
        self.tell()

    @property
    def can_draw(self) -> bool:
        """Whether there is a proven design to be run on drawn heaters, and none is just now."""
        return self.session.proof is not None and not self.session.is_computing and not self._drawing

    def put_trace_away(self) -> None:
        """Forget the trace beside the design in front, on every page."""
        self.session.put_trace_away()
        self.tell()

    async def record(self, request: RecordingRequest) -> None:
        """Record a running loop until its end is asked for; why that cannot be is told where it was asked for.

        Where one is being recorded already, by another window, that one goes on.
        """
        if self.live is not None and not self.live.is_over:
            return
        self.live_error = ""
        try:
            self.live = live = LiveLog(request)
        except HeatertuneError as problem:
            self.tell_recording(problem)
            return
        self._recording = task = asyncio.create_task(asyncio.to_thread(live.run))
        while not task.done():
            self._each(lambda page: page.show_live())
            await asyncio.wait([task], timeout=_LIVE_S)
        try:
            await task
        except Exception as problem:
            self.tell_recording(self._kind(problem))
        self._each(lambda page: page.show_live())

    def tell_recording(self, problem: Exception) -> None:
        """Tell on every page why a loop is not recorded, or its log not read."""
        self.live_error = str(problem)
        self._each(lambda page: page.show_live())

    async def end_recording(self) -> None:
        """End the recording, and wait for it; its file is whole then."""
        if self.live is not None and self._recording is not None and not self.live.is_over:
            self.live.stop()
            self._each(lambda page: page.show_live())
            await asyncio.wait([self._recording])

    def put_recording_away(self) -> None:
        """Forget a recording that is over, on every page; its file stays."""
        if self.live is not None and self.live.is_over:
            self.live = None
        self.live_error = ""
        self._each(lambda page: page.show_live())

    async def _told(self, run: Callable[[ProgressCallback], Any], what: str, wanted: Callable[[], bool]) -> Any:
        """Return what a thread gives, how far it is shown meanwhile.

        Args:
            run: in the thread, given whom to tell.
            what: it is called; "": the proof of the design in front.
            wanted: whether anybody still waits for it.

        Raises:
            _Abandoned: nobody does.
        """
        said, begun, unwanted = [""], time.monotonic(), False

        def tell(message: str) -> None:
            if unwanted:
                raise _ResultNotNeeded
            said.append(message)

        task = asyncio.create_task(asyncio.to_thread(run, tell))
        while not task.done():
            unwanted = unwanted or not wanted()
            if what:
                self.busy = f"{what}{': ' if said[-1] else ''}{for_page(said[-1])}… {time.monotonic() - begun:.0f} s"
            else:
                self.proving = said[-1]
            self._each(lambda page: page.show_progress())
            await asyncio.wait([task], timeout=_TICK_S)
        if what:
            self.busy = ""
        elif not unwanted:  # a proof may be done within one tick
            self.proving = said[-1]
        self._each(lambda page: page.show_progress())
        return task.result()

    def _kind(self, problem: Exception) -> Exception:
        """Return an error as it is told: heatertune's as they are, any other as a fault, its traceback on stderr."""
        if isinstance(problem, HeatertuneError):
            return problem
        _log.error("unexpected fault", exc_info=problem)
        return RuntimeError(fault_told(problem))

    async def zip(self, number: int, *, force: bool) -> tuple[str, bytes]:
        """Return name and content of the export files of the design that bears a number.

        Raises:
            ExportRefused: another one is in front by now, or it must not leave.
        """
        standing = self.session.front_design(number)
        return export_name(standing.log, standing.look), export_zip(standing, force=force)

    async def report(self, number: int, *, force: bool) -> tuple[str, bytes]:
        """Return name and content of the report; errors as in `zip`."""
        standing = self.session.front_design(number)
        files = standing.export(force=force) if force or standing.proof.verdict == "PASS" else {}
        page: str = await self._told(lambda _: report_page(standing, files), "drawing the report", lambda: True)
        return export_name(standing.log, standing.look), page.encode()
