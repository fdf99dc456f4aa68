"""Pages without a browser: which of them follow the session, and what is drawn for them."""

import asyncio
import gc
import json
import threading

import pytest
from nicegui import Client, core
from nicegui.outbox import Outbox
from nicegui.page import page as page_of

from heatertune.studio import browser_page as module
from heatertune.studio.browser_page import Page


def connect(client):
    client.tab_id = "tab"
    for each in client.connect_handlers:
        client.safe_invoke(each)


def disconnect(client):
    client.tab_id = None
    for each in client.disconnect_handlers:
        client.safe_invoke(each)


def opened(work):
    """Return a page and its client, as a browser gets them."""
    client = Client(page_of("/"), request=None)
    with client:
        return Page(work), client


def drawn(client):
    """Return the options of the loop's chart, of each time it was drawn."""
    codes = [data["code"] for _, kind, data in client.outbox.messages if kind == "run_javascript"]
    return [json.loads(code.split(", ", 1)[1][:-1]) for code in codes
            if code.startswith(("studio.draw", "studio.sketch")) and '"requested power' in code]


@pytest.fixture
def faults(monkeypatch):
    """What goes wrong in tasks of pages; nothing is sent to a browser."""
    async def send_nothing(_):
        pass

    seen = []
    monkeypatch.setattr(Outbox, "loop", send_nothing)
    monkeypatch.setattr(core.app, "handle_exception", seen.append)
    return seen


def told(story):
    async def begun():
        core.loop = asyncio.get_running_loop()
        return await story()

    return asyncio.run(begun())


def test_a_page_follows_from_the_first_socket_to_the_last_and_again_when_it_comes_back(work, faults):
    async def story():
        page, client = opened(work)
        counts = [len(work._pages)]
        connect(client)
        connect(client)  # before the old socket is found dead
        counts.append(len(work._pages))
        disconnect(client)
        counts.append(len(work._pages))
        connect(client)
        counts.append(len(work._pages))
        client.delete_handlers[0]()  # another socket of it is there
        return page, [*counts, len(work._pages)]

    _, counts = told(story)
    assert counts == [0, 1, 0, 1, 1]
    assert faults == []


@pytest.mark.parametrize("says_so", [True, False])
def test_no_task_draws_into_a_page_that_is_gone(work, faults, monkeypatch, says_so):
    release, begun = threading.Event(), threading.Event()
    monkeypatch.setattr(module, "_REST_S", 0.0)

    def slow(proof, before_run=bool):
        begun.set()
        release.wait(20.0)
        before_run()
        raise AssertionError("a picture of a page that is gone is drawn on")

    monkeypatch.setattr(module, "picture_of", slow)

    async def story():
        page, client = opened(work)
        connect(client)
        await asyncio.to_thread(begun.wait, 60.0)
        if says_so:
            disconnect(client)
        else:
            client.delete_handlers.clear()
        client.delete()
        del client
        gc.collect()
        release.set()
        await asyncio.sleep(0.2)
        return page

    page = told(story)
    assert begun.is_set()
    assert page.session.fault == ""
    assert faults == []


def test_a_design_whose_proof_is_refused_bears_a_zoom(work, faults, monkeypatch):
    def refuse(*_):
        raise ValueError("no proof of this")

    monkeypatch.setattr(module, "_REST_S", 0.0)
    monkeypatch.setattr("heatertune.studio.background_work.full_proof", refuse)

    async def story():
        page, client = opened(work)
        connect(client)
        await work.look()
        for _ in range(600):
            if [line["name"] for line in drawn(client)[-1]["series"]][:2] == ["nominal run", "unrounded wish"]:
                break
            await asyncio.sleep(0.05)
        return page, drawn(client)

    page, pictures = told(story)
    assert page.session.verdict == "no design"
    coarse, fine = ({line["name"]: len(line["data"]) for line in picture["series"]} for picture in pictures[-2:])
    assert [*fine] == ["nominal run", "unrounded wish", "requested power"]
    assert [*coarse] == ["nominal run", "requested power"], "while it may move"
    assert fine["nominal run"] > 1.5 * coarse["nominal run"]
