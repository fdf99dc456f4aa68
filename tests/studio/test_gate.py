"""The gate, asked as a server asks it (ASGI 3.0: the messages below are the specification's)."""

import asyncio
import re

import pytest

from heatertune.studio.access import Gate, address, new_token

TOKEN, PORT = "secret-token", 4242
HERE = (b"host", b"127.0.0.1:4242")
COOKIE = (b"cookie", b"other=1; heatertune_studio_4242=secret-token")


def ask(kind="http", query=b"", headers=(HERE,), body=(), html=b""):
    """Return what came back, and what the page behind the gate was given; `body` comes in pieces."""
    reached, sent, pieces = [], [], list(body)

    async def page(scope, receive, send):
        reached.append(b"")
        while body and (message := await receive())["type"] == "http.request":
            reached[0] += message["body"]
            if not message["more_body"]:
                break
        await send({"type": "http.response.start", "status": 200, "headers": [
            (b"x", b"y"), (b"content-type", b"text/html; charset=utf-8"), (b"content-length", b"%d" % len(html))]})
        await send({"type": "http.response.body", "body": html})

    async def receive():
        if pieces:
            return {"type": "http.request", "body": pieces.pop(0), "more_body": bool(pieces)}
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message)

    scope = {"type": kind, "query_string": query, "headers": list(headers), "path": "/_nicegui/x"}
    asyncio.run(Gate(page, token=TOKEN, port=PORT)(scope, receive, send))
    return sent, reached[0] if reached else None


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
    assert reached is None
    if kind == "http":
        assert sent[0]["status"] == 403
        assert b"secret" not in sent[1]["body"]
    else:
        assert sent == [{"type": "websocket.close", "code": 1008}]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("origin", [(), ((b"origin", b"http://127.0.0.1:4242"),)])
def test_who_shows_the_cookie_is_let_in_and_a_socket_with_the_token(kind, origin):
    assert ask(kind, b"", (HERE, COOKIE, *origin))[1] is not None
    assert ask("websocket", b"a=b&token=secret-token", (HERE, *origin))[1] is not None


def test_the_token_becomes_a_cookie_that_no_script_and_no_other_site_sees_and_leaves_the_address():
    sent, reached = ask(query=b"token=secret-token")
    headers = dict(sent[0]["headers"])
    assert reached is None
    assert (sent[0]["status"], headers[b"location"]) == (303, b"/")  # See Other: RFC 9110, 15.4.4
    assert headers[b"set-cookie"] == b"heatertune_studio_4242=secret-token; HttpOnly; SameSite=Strict; Path=/"
    sent, _ = ask(headers=(HERE, COOKIE))
    assert (b"x", b"y") in sent[0]["headers"]
    assert b"set-cookie" not in dict(sent[0]["headers"])


def test_every_answer_says_what_a_browser_may_do_with_it():
    for sent, _ in (ask(), ask(query=b"token=secret-token"), ask(headers=(HERE, COOKIE))):
        headers = dict(sent[0]["headers"])
        assert headers[b"x-content-type-options"] == b"nosniff"
        assert headers[b"referrer-policy"] == b"no-referrer"
        policy = dict(part.split(" ", 1) for part in headers[b"content-security-policy"].decode().split("; "))
        assert policy["frame-ancestors"] == policy["object-src"] == policy["base-uri"] == "'none'"
        assert "'unsafe-inline'" not in policy["script-src"]


def test_a_script_of_the_page_runs_by_a_nonce_that_is_never_the_same():
    html = b"<html><script>one()</script><script type=module>two()</script> &lt;script"
    nonces = set()
    for _ in range(2):
        start, body = ask(headers=(HERE, COOKIE), html=html)[0]
        found = re.findall(rb'<script nonce="([\w-]{22})"', body["body"])
        assert len(found) == 2
        assert len(set(found)) == 1
        nonces |= set(found)
        headers = dict(start["headers"])
        assert f"'nonce-{found[0].decode()}'" in headers[b"content-security-policy"].decode()
        assert b"content-length" not in headers, "the page has grown"
    assert len(nonces) == 2


@pytest.mark.parametrize("told", [b"", b"60000000"])
def test_more_than_a_log_may_have_is_refused_whether_its_length_is_told_or_not(told):
    piece = bytes(1_000_000)
    length = ((b"content-length", told),) if told else ()
    sent, reached = ask(headers=(HERE, COOKIE, *length), body=[piece] * 60)
    assert [message.get("status") for message in sent] == [413, None]  # Content Too Large: RFC 9110, 15.5.14
    assert b"50 MB" in sent[1]["body"]
    assert reached is None if told else len(reached) <= 50_010_000


def test_a_log_of_fifty_megabytes_passes():
    sent, reached = ask(headers=(HERE, COOKIE), body=[bytes(1_000_000)] * 50)
    assert sent[0]["status"] == 200
    assert len(reached) == 50_000_000


def test_a_fault_behind_the_gate_is_the_servers_to_tell():
    async def page(*_):
        raise ZeroDivisionError

    scope = {"type": "http", "query_string": b"", "headers": [HERE, COOKIE], "path": "/"}
    with pytest.raises(ZeroDivisionError):
        asyncio.run(Gate(page, token=TOKEN, port=PORT)(scope, None, None))


def test_start_and_end_of_the_server_pass():
    assert ask("lifespan")[1] is not None


def test_every_token_is_new_and_long_and_fits_an_address():
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{43}", token) for token in tokens)  # 256 bits in base 64
    assert address(80, "t") == "http://127.0.0.1:80/?token=t"
