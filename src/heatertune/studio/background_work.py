"""Slow work behind the pages: fits, loops, proofs and searches in threads, the newest request first.

One instance serves the session, whatever windows are open. Also the downloads (export files as one zip, the report;
the same design gives the same bytes) and the as-left comparison of a trace with the current design.
"""

from __future__ import annotations

import asyncio
import io
import logging
import time
import zipfile
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final, Protocol

from heatertune.chain.documents import words_document
from heatertune.chain.pipeline import dossier
from heatertune.codec import DATA, decode, encode, plain, to_json
from heatertune.compiled import decide
from heatertune.errors import HeatertuneError
from heatertune.log.log_values import Log
from heatertune.model.model_values import FittedModel
from heatertune.plc import controller_for
from heatertune.processors import ProgressCallback, interruptible
from heatertune.proof.as_left import AsLeft, as_left
from heatertune.proof.proof_document import ProofView
from heatertune.report.as_left_section import judgement_text, measured_text, worst_text
from heatertune.report.html import bullets, table, text_of
from heatertune.report.report_text import limit_text, readable_name
from heatertune.settings import AsLeftSettings, FitSettings
from heatertune.studio.live_log import LiveLog, RecordingRequest
from heatertune.studio.loop_settings import (
    DRAWN,
    CandidateWords,
    LoopView,
    StudioSettings,
    document_of,
    find_design,
    first_look,
    full_proof,
    optimum,
    results_on_samples,
)
from heatertune.studio.session import FrontDesign, Session, Ticket, fit_log, read_source
from heatertune.studio.views import export_name
from heatertune.studio.wording import fault_text, for_page
from heatertune.studio.zones_design import DesignedZones, ZonesRequest, design_of, suitable_range, zones_found, zones_of

__all__ = [
    "Follower", "Work", "compare_with_proof", "export_zip", "figures", "left_sentence", "report_page",
]


_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold: no date


def export_zip(standing: FrontDesign, *, force: bool) -> bytes:
    """Return the export files with `data/words.json` and `data/proof.json`, as `heatertune export-db` writes them.

    The main file of the controller comes first.

    Raises:
        ExportRefused: the verdict is not PASS and it is not forced.
    """
    files, gains, proof = standing.export(force=force), standing.look.gains, standing.proof
    documents = {
        f"{DATA}/words.json": to_json(words_document(gains.words, proof, files, gains.search())),
        f"{DATA}/proof.json": to_json(document_of(proof)),
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        first = controller_for(gains.words.target).main_file
        for name, content in sorted({**files, **documents}.items(), key=lambda entry: (entry[0] != first, entry[0])):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
    return packed.getvalue()


def report_page(standing: FrontDesign, files: Mapping[str, str | bytes]) -> str:
    """Return `report.html` of a proven design, as left where a trace was held against it.

    Args:
        standing: the design.
        files: that were exported; none for words that failed and were not forced.
    """
    from heatertune.report import render

    gains = standing.look.gains
    content = dossier(standing.log, standing.fitted, gains.design, standing.proof, files, gains.search(), gains.recipe)
    left = {} if standing.as_left is None else {"as_left": plain(encode(standing.as_left))}
    return render(content | left)


def compare_with_proof(standing: FrontDesign, log: Log, about: AsLeftSettings, progress: ProgressCallback) -> AsLeft:
    """Return a trace beside the proof of a design; errors as `heatertune.proof.as_left.as_left`."""
    proof = decode(ProofView, plain(document_of(standing.proof)), "the proof")
    return as_left(log, standing.look.gains.words, standing.fitted, proof, about, progress=progress)


def left_sentence(left: AsLeft, verdict: str) -> str:
    """Return the result of the trace as one sentence that can be read out; `verdict`: of the proof."""
    figure_count = sum(line.measured is not None for line in left.measurements)
    assurance = ("the curve is inside of what the proven runs do, and each of the "
                 f"{figure_count} figures that the trace shows is no worse than proven.")
    proof = "" if verdict == "PASS" else f" The proof of these words is itself {verdict}."
    return for_page(f"{left.verdict}: {' '.join(left.messages) or assurance}{proof}")


def figures(left: AsLeft) -> str:
    """Return limit, proven worst and measured side by side, why a figure is not measured, and the notes, as HTML."""
    lines = plain(encode(left))["measurements"]
    rows = [[*_proven(line), measured_text(line), judgement_text(line) or for_page(line["message"])]
            for line in lines if line["measured"] is not None]
    unseen = [[*_proven(line), for_page(line["message"])] for line in lines if line["measured"] is None]
    heads = ("criterion", "limit", "proven worst")
    text = f"<p>{text_of(left.trace)}, at {left.setpoint_degC:g} °C.</p>"
    if rows:
        text += table([*heads, "measured", "as proven"], rows, numeric=(1, 2, 3))
    if unseen:
        folded = table([*heads, "why it is not measured"], unseen, numeric=(1, 2))
        text += f"<details><summary>Not measured, and why ({len(unseen)})</summary>{folded}</details>"
    return text + bullets([for_page(note) for note in left.notes])


def _proven(line: Mapping[str, Any]) -> tuple[str, str, str]:
    return readable_name(line["name"]), limit_text(line), worst_text(line)


_FRAME_S: Final = 0.03  # in which a browser draws the loop before more is sent
_REST_S: Final = 0.15  # a slider that moves on within this time wants no proof yet
_SLOW_S: Final = 2.0  # a compiled loop takes less
_SEEK_S: Final = 1.0  # who looks at a FAIL for so long may want to know what would pass
_TICK_S: Final = 0.2  # between two looks at how far something is, each of which a browser draws
_LIVE_S: Final = 0.5  # between two pictures of a loop that is being recorded

_log: Final = logging.getLogger(__name__)


class Follower(Protocol):
    """A page."""

    def show(self) -> object:
        """Show the session as it is now."""

    def show_move(self) -> object:
        """Show that settings moved, as what is seen is no longer theirs; the rest follows."""

    def show_loop(self, look: LoopView) -> object:
        """Draw a loop, and leave all else."""

    def show_progress(self) -> object:
        """Show how far the work is."""

    def show_live(self) -> object:
        """Show the loop that is being recorded."""


class _ResultNotNeeded(Exception):
    """Nobody wants the result any more."""


def _note_end(task: asyncio.Task[Any]) -> None:
    """Take the exception of a task, which nobody waits for any more where the studio ends meanwhile."""
    if not task.cancelled():
        task.exception()


class Work:
    """The work of a session.

    Args:
        session: what is worked on; touched in the event loop's thread only.
        find_optimum: as `loop_settings.optimum`.

    Attributes:
        busy: what takes long and how far it is, a few words; "" where nothing does.
        proving: how far the proof of the design in front is, as "18 of 54 runs"; "" before it begins.
        live: the loop that is being recorded, or was; None: none.
        live_error: why it is not, one line; "" where it is.
        zone_files, zone_names: log of several zones, and their names; empty: none.
        zones: the last design of them; None: none.
        zones_error: why there is no other one, one line; "" where there is.
    """

    def __init__(
        self, session: Session,
        find_optimum: Callable[[FittedModel, StudioSettings, ProgressCallback], CandidateWords] = optimum,
    ) -> None:
        self.session, self._find_optimum = session, find_optimum
        self.busy = self.proving = self.live_error = self.zones_error = ""
        self.zone_files: tuple[tuple[str, bytes], ...] = ()
        self.zone_names: tuple[str, ...] = ()
        self.zones: DesignedZones | None = None
        self._zones_begun = 0
        self.live: LiveLog | None = None
        self._recording: asyncio.Task[None] | None = None
        self._pages: list[Follower] = []
        self._fitting = self._looking = self._proving = self._seeking = self._drawing = False
        self._drawn_first: LoopView | None = None
        self._moved_at = 0.0
        self._moved = asyncio.Event()
        self._held = 0

    def follow(self, page: Follower) -> None:
        """Tell a page from now on what changes."""
        self._pages.append(page)

    def forget(self, page: Follower) -> None:
        """Tell a page no more: it is closed."""
        self._pages = [other for other in self._pages if other is not page]

    def tell(self) -> None:
        """Let every page show the session as it is now."""
        self._show_on_pages(lambda page: page.show())

    def _show_on_pages(self, show: Callable[[Follower], object]) -> None:
        for page in self._pages:
            try:
                show(page)
            except Exception:  # one page that cannot be drawn keeps no other from the truth
                _log.exception("a page could not be drawn")

    def fault(self, problem: Exception) -> str:
        """Tell on every page that something went wrong inside, its traceback on stderr; return the sentence."""
        _log.error("unexpected fault", exc_info=problem)
        self.session.fault = fault_text(problem)
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
        """Read a path or built-in table and fit it; a folder has its heater, settings and design."""
        try:
            design = await asyncio.to_thread(read_source, source)
        except HeatertuneError as problem:
            self.session.refuse_file(problem)
            self.tell()
            return
        if design.fitted is None:
            await self._fit(design.log)
        else:
            self.session.load(design)
            await self.look()

    async def take(self, log: Log, settings: FitSettings) -> None:
        """Fit a log with what is known beside it."""
        await self._fit(log, settings)

    async def _fit(self, log: Log, settings: FitSettings | None = None) -> None:
        session = self.session
        ticket, self._fitting = session.begin(log, settings), True
        self.tell()

        def run(tell: ProgressCallback) -> Any:
            return fit_log(log, tell, settings)

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
        self._moved.set()  # what nobody waits for any more ends before the next loop is computed
        self._show_on_pages(lambda page: page.show_move())

    async def look(self) -> None:
        """Show the loop of the settings; while one is computed, only the newest settings wait."""
        self._moved_at = time.monotonic()
        session = self.session
        if self._looking:
            return
        if session.fitted is None:
            self.tell()
            return
        self._looking = True
        try:
            while not session.show_remembered():
                ticket, fitted, settings, gains = session.ticket, session.fitted, session.settings, session.gains()
                key = session.key
                try:
                    opening = asyncio.to_thread(first_look, fitted, settings, gains, whole=False)
                    look = await self._whole(key, fitted, await self._slowly(opening, settings.target))
                except Exception as problem:
                    if session.look_refused(ticket, self._kind(problem)):
                        break
                    continue
                if look is None:
                    continue
                session.look_done(ticket, look)
                await self._show_first(look)
                self._show_on_pages(lambda page: page.show_progress())
                if ticket == session.ticket:
                    await asyncio.to_thread(getattr, look, "margins")  # of the tables below the picture
            await self._show_first(session.front)
        finally:
            self._looking = False
        self.tell()
        await self._prove()
        await self._seek()

    async def _show_first(self, look: LoopView | None) -> None:
        """Draw a loop on every page, unless it was drawn last, and give browsers time before more is sent."""
        if look is None or look is self._drawn_first:
            return
        self._drawn_first = look
        self._show_on_pages(lambda page: page.show_loop(look))
        await asyncio.sleep(_FRAME_S)

    async def _whole(self, key: Ticket, fitted: FittedModel, look: LoopView) -> LoopView | None:
        """Return a loop, of an opening, which is shown, the whole of it once sliders rest; None: they moved on."""
        if not look.is_opening:
            return look
        await self._show_first(look)
        task: asyncio.Task[LoopView] | None = None
        while task is None or not task.done():
            self._moved.clear()
            if self.session.key != key:
                return None
            if task is None and time.monotonic() >= self._moved_at + _REST_S:
                task = asyncio.create_task(asyncio.to_thread(first_look, fitted, look.settings, look.gains))
                task.add_done_callback(_note_end)
            await self._move_or_tick(task)
        return task.result()

    async def _slowly(self, work: Coroutine[Any, Any, LoopView], target: str) -> LoopView:
        """Return the loop of a controller; where its code is not compiled yet, say why the page waits."""
        task = asyncio.ensure_future(work)
        if not (await asyncio.wait([task], timeout=_SLOW_S))[0]:
            self.busy = f"running {target}, whose loop is not compiled yet…"
            self._show_on_pages(lambda page: page.show_progress())
            await asyncio.wait([task])
            self.busy = ""
        return task.result()

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
            gains = self._find_optimum(fitted, look.settings, tell)  # type: ignore[arg-type]  # there is a look, so a heater
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
            left = await self._told(lambda tell: compare_with_proof(standing, log, about, tell),
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
            samples = await self._told(lambda _: results_on_samples(proven.fitted, proven.look), what, lambda: True)
            self.session.samples_done(ticket, proven.proof, samples)
        except Exception as problem:
            self.session.fault = str(self._kind(problem))
        finally:
            self._drawing = False
        self.tell()

    @property
    def can_draw(self) -> bool:
        """Whether there is a proven design to be run on drawn heaters, and none is just now."""
        return self.session.proof is not None and not self.session.is_computing and not self._drawing

    async def offer_zones(self, files: Sequence[tuple[str, bytes]]) -> None:
        """Let the pages design zones where files hold several."""
        if zones := await asyncio.to_thread(zones_found, files):
            self.take_zones(files, zones)
            self.tell()

    def load_zones(self, source: str) -> bool:
        """Begin with the zones of a path; return whether it holds any. Errors as `zones_of`."""
        files, zones, design = zones_of(source)
        if zones:
            self.take_zones(files, zones)
            self.zones = design
        if design is not None:
            words, scaling = design.proof.words[0], design.proof.words[0].scaling
            self.session.change(target=words.target, structure=design.proof.design.structure, input=scaling.input,
                                low_degC=scaling.low_degC, high_degC=scaling.high_degC)
        return bool(zones)

    def take_zones(self, files: Sequence[tuple[str, bytes]], zones: tuple[str, ...]) -> None:
        """Take the log of several zones, the sensor's range as it suits where no heater is in front."""
        self.zone_files, self.zone_names, self.zones, self.zones_error = tuple(files), zones, None, ""
        if files and self.session.fitted is None:
            with suppress(HeatertuneError):
                self.session.change(**suitable_range(self.zone_files, zones))

    def put_zones_away(self) -> None:
        """Forget the zones, on every page."""
        self._zones_begun += 1
        self.take_zones((), ())
        self.tell()

    async def design_zones(self, request: ZonesRequest) -> None:
        """Show the design of several zones as soon as it is proven; the newest request counts."""
        self._zones_begun += 1
        number, self.zones_error = self._zones_begun, ""
        before = decide(None)  # the loop of zones, which nothing compiles in advance, is compiled where it pays
        if before != "kept":
            decide(before)
        try:
            self.zones = await self._told(
                lambda tell: design_of(request, tell), "designing all zones", lambda: number == self._zones_begun)
        except _ResultNotNeeded:
            return
        except Exception as problem:
            self.zones_error = str(self._kind(problem))
        self.tell()

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
            self._show_on_pages(lambda page: page.show_live())
            await asyncio.wait([task], timeout=_LIVE_S)
        try:
            await task
        except Exception as problem:
            self.tell_recording(self._kind(problem))
        self._show_on_pages(lambda page: page.show_live())

    def tell_recording(self, problem: Exception) -> None:
        """Tell on every page why a loop is not recorded, or its log not read."""
        self.live_error = str(problem)
        self._show_on_pages(lambda page: page.show_live())

    async def end_recording(self) -> None:
        """End the recording, and wait for it; its file is whole then."""
        if self.live is not None and self._recording is not None and not self.live.is_over:
            self.live.stop()
            self._show_on_pages(lambda page: page.show_live())
            await asyncio.wait([self._recording])

    def put_recording_away(self) -> None:
        """Forget a recording that is over, on every page; its file stays."""
        if self.live is not None and self.live.is_over:
            self.live = None
        self.live_error = ""
        self._show_on_pages(lambda page: page.show_live())

    async def _told(self, run: Callable[[ProgressCallback], Any], what: str, wanted: Callable[[], bool]) -> Any:
        """Return what a thread gives, how far it is shown meanwhile.

        Args:
            run: in the thread, given whom to tell.
            what: it is called; "": the proof of the design in front.
            wanted: whether anybody still waits for it.

        Raises:
            _ResultNotNeeded: nobody does.
        """
        notes, start, unwanted = [""], time.monotonic(), False

        def check() -> None:
            if unwanted:
                raise _ResultNotNeeded

        def tell(message: str) -> None:
            check()
            notes.append(message)

        def work() -> Any:
            with interruptible(check):
                return run(tell)

        task = asyncio.create_task(asyncio.to_thread(work))
        task.add_done_callback(_note_end)
        while not task.done():
            self._moved.clear()
            unwanted = unwanted or not wanted()
            if what:
                self.busy = f"{what}{': ' if notes[-1] else ''}{for_page(notes[-1])}… {time.monotonic() - start:.0f} s"
            else:
                self.proving = notes[-1]
            self._show_on_pages(lambda page: page.show_progress())
            await self._move_or_tick(task)
        if what:
            self.busy = ""
        elif not unwanted:  # a proof may be done within one tick
            self.proving = notes[-1]
        self._show_on_pages(lambda page: page.show_progress())
        return task.result()

    async def _move_or_tick(self, task: asyncio.Task[Any] | None) -> None:
        """Wait for the end of a task, a move or a tick, whatever comes first."""
        moved = asyncio.create_task(self._moved.wait())
        await asyncio.wait([moved] if task is None else [task, moved], timeout=_TICK_S,
                           return_when=asyncio.FIRST_COMPLETED)
        moved.cancel()

    def _kind(self, problem: Exception) -> Exception:
        """Return an error as it is told: heatertune's as they are, any other as a fault, its traceback on stderr."""
        if isinstance(problem, HeatertuneError):
            return problem
        _log.error("unexpected fault", exc_info=problem)
        return RuntimeError(fault_text(problem))

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
