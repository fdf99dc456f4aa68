"""What takes long, beside the page: fits, loops and proofs in threads, the newest wish first, stale results unseen."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any, Final

from heatertune.errors import ExportRefused, HeatertuneError
from heatertune.log.values import Log
from heatertune.studio.downloads import export_zip, report_page
from heatertune.studio.loop import first_look, full_proof, optimum
from heatertune.studio.session import Session
from heatertune.studio.sources import fit_log, read_dropped, read_source

__all__ = ["Work"]

_REST_S: Final = 0.3  # a slider that moves on within this time wants no proof yet
_TICK_S: Final = 0.5


class Work:
    """The work of one page.

    Args:
        session: what is worked on; touched in the event loop's thread only.
        shown: called when something new can be seen.
        busy: told what takes long, "" when it is done.
    """

    def __init__(self, session: Session, *, shown: Callable[[], object], busy: Callable[[str], object]) -> None:
        self.session, self._shown, self._busy = session, shown, busy
        self._looking = self._proving = False
        self._moved_at = 0.0

    async def go_on(self) -> None:
        """Fit a log that waits, else show the loop of the settings."""
        if self.session.fitted is None and self.session.coming is not None:
            await self._fit(self.session.coming)
        else:
            await self.look()

    async def open(self, source: str) -> None:
        """Read a path or built-in table and fit it."""
        await self._take(lambda: read_source(source).log)

    async def drop(self, name: str, content: bytes) -> None:
        """Read a dropped file and fit it."""
        await self._take(lambda: read_dropped(name, content))

    async def _take(self, read: Callable[[], Log]) -> None:
        try:
            log = await asyncio.to_thread(read)
        except HeatertuneError as problem:
            self.session.refuse_file(problem)
            self._shown()
            return
        await self._fit(log)

    async def _fit(self, log: Log) -> None:
        ticket = self.session.begin(log)
        self._shown()
        try:
            fitted = await self._told(f"fitting {log.name}", lambda tell: fit_log(log, tell))
        except HeatertuneError as problem:
            self.session.refuse_file(problem)
            self._shown()
            return
        if self.session.fit_done(ticket, fitted):
            await self.look()

    async def _told(self, what: str, run: Callable[[Callable[[str], None]], Any]) -> Any:
        """Return what `run` gives, its progress and the time it takes shown meanwhile."""
        stages, begun = [what], time.monotonic()
        task = asyncio.create_task(asyncio.to_thread(run, stages.append))
        while not task.done():
            self._busy(f"{stages[-1]}… {time.monotonic() - begun:.0f} s")
            await asyncio.wait([task], timeout=_TICK_S)
        self._busy("")
        return task.result()

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
                except HeatertuneError as problem:
                    if ticket == session.ticket:
                        session.fail(problem)
                        break
        finally:
            self._looking = False
        self._shown()
        await self._prove()

    async def _prove(self) -> None:
        """Prove what waits, one at a time, once the sliders rest."""
        if self._proving:
            return
        self._proving = True
        try:
            while self.session.unproven():
                await asyncio.sleep(max(0.0, self._moved_at + _REST_S - time.monotonic()))
                if time.monotonic() < self._moved_at + _REST_S or not (waiting := self.session.unproven()):
                    continue
                ticket, look = waiting[0]
                assert self.session.fitted is not None
                try:
                    self.session.proof_done(ticket, await asyncio.to_thread(full_proof, self.session.fitted, look))
                except HeatertuneError as problem:
                    self.session.proof_refused(ticket, problem)
                self._shown()
        finally:
            self._proving = False

    async def optimum(self) -> None:
        """Search the optimum for the settings, and show it where they are still the same."""
        session = self.session
        ticket, fitted, settings = session.ticket, session.fitted, session.settings
        if fitted is None:
            return
        try:
            gains = await self._told("searching the optimum", lambda tell: optimum(fitted, settings, tell))
        except HeatertuneError as problem:
            session.fail(problem)
            self._shown()
            return
        if session.optimum_done(ticket, gains):
            await self.look()

    async def zip(self, *, force: bool) -> bytes:
        """Return the export files of the proven design as a zip; raise ExportRefused where they must not leave."""
        look, proof, files = self.session.front, self.session.proof, self.session.export(force=force)
        assert look is not None
        assert proof is not None
        return export_zip(files, look, proof)

    async def report(self, *, force: bool) -> bytes:
        """Return the report of the proven design; raise ExportRefused where there is no proof."""
        session = self.session
        log, fitted, look, proof = session.log, session.fitted, session.front, session.proof
        if log is None or fitted is None or look is None or proof is None:
            raise ExportRefused("the words are not proven yet")
        files = session.export(force=force) if force or proof.verdict == "PASS" else {}
        page: str = await self._told("drawing the report", lambda _: report_page(log, fitted, look, proof, files))
        return page.encode()
