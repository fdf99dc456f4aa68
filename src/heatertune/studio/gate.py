"""Who may in: whoever shows the token, on the loopback address, from the studio's own page."""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qs

__all__ = ["HOST", "Gate", "address", "new_token"]

HOST: Final = "127.0.0.1"

_Scope = MutableMapping[str, Any]
_Door = Callable[[MutableMapping[str, Any]], Awaitable[None]]
_Mouth = Callable[[], Awaitable[MutableMapping[str, Any]]]


def new_token() -> str:
    """Return 256 random bits as they stand in a URL."""
    return secrets.token_urlsafe(32)


def address(port: int, token: str) -> str:
    """Return the URL that the user opens."""
    return f"http://{HOST}:{port}/?token={token}"


class Gate:
    """ASGI middleware: 403 for every request and socket without the token.

    The token comes in the URL once, and as a cookie from then on, which the browser sends to this host only, from no
    other site, and shows to no script. The cookie carries the port in its name: cookies do not tell ports apart.
    A request whose Host or Origin is another one (a page elsewhere that resolves its name to 127.0.0.1) stays outside.
    """

    def __init__(self, app: Any, *, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"heatertune_studio_{port}"
        self._here = f"{HOST}:{port}"

    async def __call__(self, scope: _Scope, receive: _Mouth, send: _Door) -> None:
        """Let one connection pass, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        by_url = self._matches(parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0])
        if not self._from_here(headers) or not (by_url or self._matches(self._in_cookie(headers))):
            await _refuse(scope, receive, send)
            return

        async def send_with_cookie(message: MutableMapping[str, Any]) -> None:
            if by_url and message["type"] == "http.response.start":
                cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
                message["headers"] = [*message.get("headers", ()), (b"set-cookie", cookie.encode())]
            await send(message)

        await self._app(scope, receive, send_with_cookie)

    def _from_here(self, headers: MutableMapping[str, str]) -> bool:
        return headers.get("host") == self._here and headers.get("origin", f"http://{self._here}") == f"http://{self._here}"

    def _in_cookie(self, headers: MutableMapping[str, str]) -> str:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return ""
        return "" if cookie is None else cookie.value

    def _matches(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._token.encode())


async def _refuse(scope: _Scope, receive: _Mouth, send: _Door) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})  # before it was accepted: the server answers 403
        return
    await send({"type": "http.response.start", "status": 403, "headers": [(b"content-type", b"text/plain")]})
    await send({"type": "http.response.body", "body": b"403: open the address that heatertune studio printed\n"})
