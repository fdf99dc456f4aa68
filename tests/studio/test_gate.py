"""The gate, asked as a server asks it (ASGI 3.0: the messages below are the specification's)."""

import asyncio
import re

import pytest

from heatertune.studio.gate import Gate, address, new_token

TOKEN, PORT = "secret-token", 4242
HERE = (b"host", b"127.0.0.1:4242")
COOKIE = (b"cookie", b"other=1; heatertune_studio_4242=secret-token")


def ask(kind="http", query=b"", headers=(HERE,)):
    """Return what came back, and whether the page behind the gate was reached."""
    reached, sent = [], []

    async def page(scope, receive, send):
        reached.append(scope["type"])
        await send({"type": "http.response.start", "status": 200, "headers": [(b"x", b"y")]})

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message)

    scope = {"type": kind, "query_string": query, "headers": list(headers), "path": "/_nicegui/x"}
    asyncio.run(Gate(page, token=TOKEN, port=PORT)(scope, receive, send))
    return sent, bool(reached)


@pytest.mark.parametrize(("query", "headers"), [
    (b"", (HERE,)),
    (b"token=", (HERE,)),
    (b"token=secret-toke", (HERE,)),
    (b"token=secret-token-", (HERE,)),
    (b"Token=secret-token", (HERE,)),
    (b"token=\xff\xfe", (HERE,)),
    (b"token=wrong&token=secret-token", (HERE,)),
    (b"", (HERE, (b"cookie", b"heatertune_studio_4242=wrong"))),
    (b"", (HERE, (b"cookie", b"heatertune_studio_4243=secret-token"))),
    (b"", (HERE, (b"cookie", b"\x00;;=,=;"))),
    (b"token=secret-token", ((b"host", b"evil.example:4242"),)),
    (b"token=secret-token", ((b"host", b"127.0.0.1:4243"),)),
    (b"token=secret-token", ()),
    (b"token=secret-token", (HERE, (b"origin", b"http://evil.example"))),
    (b"", (HERE, COOKIE, (b"origin", b"http://127.0.0.1:9999"))),
    (b"", (HERE, COOKIE, (b"origin", b"null"))),
])
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_who_does_not_belong_stays_outside(kind, query, headers):
    sent, reached = ask(kind, query, headers)
    assert not reached
    if kind == "http":
        assert sent[0]["status"] == 403
        assert b"secret" not in sent[1]["body"]
    else:
        assert sent == [{"type": "websocket.close", "code": 1008}]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("origin", [(), ((b"origin", b"http://127.0.0.1:4242"),)])
def test_who_shows_the_token_or_its_cookie_is_let_in(kind, origin):
    assert ask(kind, b"a=b&token=secret-token", (HERE, *origin))[1]
    assert ask(kind, b"", (HERE, COOKIE, *origin))[1]


def test_the_token_becomes_a_cookie_that_no_script_and_no_other_site_sees():
    sent, _ = ask(query=b"token=secret-token")
    (cookie,) = [value.decode() for name, value in sent[0]["headers"] if name == b"set-cookie"]
    assert cookie == "heatertune_studio_4242=secret-token; HttpOnly; SameSite=Strict; Path=/"
    assert (b"x", b"y") in sent[0]["headers"]
    assert b"set-cookie" not in dict(ask(headers=(HERE, COOKIE))[0][0]["headers"])


def test_start_and_end_of_the_server_pass():
    assert ask("lifespan")[1]


def test_every_token_is_new_and_long_and_fits_an_address():
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{43}", token) for token in tokens)  # 256 bits in base 64
    assert address(80, "t") == "http://127.0.0.1:80/?token=t"
