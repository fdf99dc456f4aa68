"""Who may in, and with how much: whoever shows the token, on the loopback address, from the studio's own page."""

from __future__ import annotations

import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qs

__all__ = ["HOST", "LARGEST_LOG", "Gate", "address", "new_token"]

HOST: Final = "127.0.0.1"
LARGEST_LOG: Final = 50_000_000  # bytes; a year of readings every second is about that
_ENVELOPE: Final = 10_000  # bytes that a form takes around the file in it

_Message = MutableMapping[str, Any]
_Door = Callable[[_Message], Awaitable[None]]
_Mouth = Callable[[], Awaitable[_Message]]

#: of what stands in the page itself, a script runs only with the nonce of this very answer. Two exceptions stay:
#: NiceGUI makes its handlers of text (eval), and Vue, Quasar and ECharts set styles on elements
_POLICY: Final = "; ".join((
    "default-src 'self'", "script-src 'self' 'nonce-{nonce}' 'unsafe-eval'", "style-src 'self' 'unsafe-inline'",
    "connect-src 'self' ws://{here}", "img-src 'self' data: blob:", "font-src 'self' data:", "object-src 'none'",
    "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'"))
_SCRIPT: Final = re.compile(rb"<script\b")


def new_token() -> str:
    """Return 256 random bits as they stand in a URL."""
    return secrets.token_urlsafe(32)


def address(port: int, token: str) -> str:
    """Return the URL that the user opens."""
    return f"http://{HOST}:{port}/?token={token}"


class Gate:
    """ASGI middleware: 403 for every request and socket without the token, 413 for more than a log may have.

    The token comes in the URL once, which is answered by a cookie and the way to the page without it: an address is
    kept in histories and shown on screens. The browser sends the cookie to this host only, from no other site, and
    shows it to no script. It carries the port in its name: cookies do not tell ports apart.
    A request whose Host or Origin is another one (a page elsewhere that resolves its name to 127.0.0.1) stays outside.
    """

    def __init__(self, app: Any, *, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"heatertune_studio_{port}"
        self._here = f"{HOST}:{port}"

    async def __call__(self, scope: _Message, receive: _Mouth, send: _Door) -> None:
        """Let one connection pass, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        by_url = self._matches(parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0])
        is_known = self._from_here(headers) and (by_url or self._matches(self._in_cookie(headers)))
        if scope["type"] == "websocket":
            await (self._app(scope, receive, send) if is_known else _refuse_socket(receive, send))
        elif not is_known:
            await self._answer(send, 403, b"403: open the address that heatertune studio printed\n")
        elif by_url:
            cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/".encode()
            await self._answer(send, 303, b"", (b"location", b"/"), (b"set-cookie", cookie))
        else:
            await self._let_in(scope, headers, receive, send)

    async def _let_in(self, scope: _Message, headers: MutableMapping[str, str], receive: _Mouth, send: _Door) -> None:
        """Let a request pass while it is small enough; nothing is kept of one that is not."""
        length = headers.get("content-length", "")
        if length.isdigit() and int(length) > LARGEST_LOG + _ENVELOPE:
            await self._answer(send, 413, _TOO_MUCH)
            return
        guarded, received_bytes, refused = self._guarded(send), 0, False

        async def counted() -> _Message:
            nonlocal received_bytes, refused
            message: _Message = {"type": "http.disconnect"} if refused else await receive()
            received_bytes += len(message.get("body", b""))
            if received_bytes > LARGEST_LOG + _ENVELOPE and not refused:
                refused = True  # what no length told: the page behind the gate sees a visitor who left
                await self._answer(send, 413, _TOO_MUCH)
                message = {"type": "http.disconnect"}
            return message

        async def answered(message: _Message) -> None:
            if not refused:
                await guarded(message)

        try:
            await self._app(scope, counted, answered)
        except Exception:
            if not refused:
                raise

    def _guarded(self, send: _Door) -> _Door:
        """Return a door that says on every answer what a browser may do with it, and marks the page's own scripts."""
        nonce, is_page = secrets.token_urlsafe(16), False

        async def door(message: _Message) -> None:
            nonlocal is_page
            if message["type"] == "http.response.start":
                own = [(name, value) for name, value in message.get("headers", ()) if name.lower() not in _OURS]
                is_page = any(name.lower() == b"content-type" and value.startswith(b"text/html") for name, value in own)
                if is_page:  # it grows by the nonces
                    own = [(name, value) for name, value in own if name.lower() != b"content-length"]
                message["headers"] = [*own, *self._said(nonce)]
            elif is_page and message["type"] == "http.response.body":
                message["body"] = _SCRIPT.sub(b'<script nonce="%s"' % nonce.encode(), message.get("body", b""))
            await send(message)

        return door

    def _said(self, nonce: str) -> list[tuple[bytes, bytes]]:
        policy = _POLICY.format(nonce=nonce, here=self._here)
        return [(b"content-security-policy", policy.encode()), (b"x-content-type-options", b"nosniff"),
                (b"referrer-policy", b"no-referrer"), (b"x-frame-options", b"DENY")]

    async def _answer(self, send: _Door, status: int, body: bytes, *headers: tuple[bytes, bytes]) -> None:
        all_headers = [(b"content-type", b"text/plain"), *headers, *self._said("none")]
        await send({"type": "http.response.start", "status": status, "headers": all_headers})
        await send({"type": "http.response.body", "body": body})

    def _from_here(self, headers: MutableMapping[str, str]) -> bool:
        return headers.get("host") == self._here and headers.get("origin", f"http://{self._here}") == f"http://{self._here}"

    def _in_cookie(self, headers: MutableMapping[str, str]) -> str:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return ""
        return "" if cookie is None else cookie.value

    def _matches(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self._token.encode())


_TOO_MUCH: Final = b"413: a log may have up to 50 MB\n"
_OURS: Final = (b"content-security-policy", b"x-content-type-options", b"referrer-policy", b"x-frame-options")


async def _refuse_socket(receive: _Mouth, send: _Door) -> None:
    await receive()
    await send({"type": "websocket.close", "code": 1008})  # before it was accepted: the server answers 403
