"""Start: the page on the loopback address, its address on stdout."""

from __future__ import annotations

import asyncio
import socket

from nicegui import app, background_tasks, ui

from heatertune.errors import InputError
from heatertune.plc import TARGETS
from heatertune.studio.access import HOST, Gate, address, new_token
from heatertune.studio.browser_page import Page
from heatertune.studio.session import Session, read_source
from heatertune.studio.warm_up import warm
from heatertune.studio.work import Work

__all__ = ["serve"]


def serve(source: str | None, *, port: int | None, browser: bool) -> None:
    """Serve the studio until it is interrupted.

    Args:
        source: a log file, a built-in table or a folder of `heatertune design` to begin with; None: an empty page.
        port: on 127.0.0.1; None: one that is free.
        browser: whether the page is opened in the user's browser.

    Raises:
        InputError: the source cannot be read, the port is taken.
    """
    session = Session()
    if source is not None:
        session.load(read_source(source))
    port, token = _free(port), new_token()
    app.add_middleware(Gate, token=token, port=port)
    app.on_startup(lambda: background_tasks.create(_tell(port, token)))
    targets = list(dict.fromkeys([session.settings.target, *TARGETS]))
    app.on_startup(lambda: background_tasks.create(warm(targets)))

    work = Work(session)
    app.on_exception(work.fault)
    app.on_shutdown(work.end_recording)

    def page() -> None:
        Page(work)

    ui.page("/")(page)

    ui.run(
        host=HOST, port=port, show=f"/?token={token}" if browser else False, reload=False, show_welcome_message=False,
        title="heatertune studio", language="en-US", favicon="♨", reconnect_timeout=30.0,
    )


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
