"""What stands between any page of the browser and the data: Host, Origin, method, token.

A page of another site can make the browser send requests here, or, by a name that it lets point
to 127.0.0.1, even read the answers. So a request passes only if its Host is this server, its
Origin, where it has one, is this server too, and if it carries the token that only the printed
address holds.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Awaitable, Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

__all__ = ["HEADERS", "Guard", "new_token"]

Scope = Mapping[str, Any]
Receive = Callable[[], Awaitable[Any]]
Send = Callable[[Any], Awaitable[None]]
Application = Callable[[Any, Any, Any], Awaitable[None]]

HEADERS: dict[str, str] = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; worker-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
}
"""Of every answer. Styles may be inline: charts write theirs so; scripts may not."""
TOKEN_HEADER = "x-granufab-token"
_METHODS = ("GET", "HEAD")


def new_token() -> str:
    """256 random bits as text for an address."""
    return secrets.token_urlsafe(32)


class Guard:
    """An ASGI application that lets only the user's own page reach another one.

    Args:
        application: what is guarded.
        token: of the address, then of the cookie or of the header ``X-Granufab-Token``.
        port: of the server; its hosts are ``127.0.0.1:port`` and ``localhost:port``.
    """

    def __init__(self, application: Application, *, token: str, port: int) -> None:
        self._application, self._token = application, token
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        # Cookies of 127.0.0.1 are shared by all ports: each viewer has its own name.
        self.cookie = f"granufab_{hashlib.sha256(token.encode()).hexdigest()[:12]}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""
        if scope["type"] == "lifespan":
            await self._application(scope, receive, send)
            return
        if scope["type"] != "http":
            return  # no other connections: the server closes them
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await _refuse(send, *refusal)
            return
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])

        async def dressed(message: Any) -> None:
            if message["type"] == "http.response.start":
                more = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
                if given and scope["path"] == "/":
                    more.append((b"set-cookie", self._cookie_text().encode()))
                message = {**message, "headers": [*message.get("headers", []), *more]}
            await send(message)

        await self._application(scope, receive, dressed)

    def _refusal(self, scope: Scope, headers: Mapping[str, list[str]]) -> tuple[int, str] | None:
        """Status and words where the request must not pass."""
        if [host.lower() for host in headers.get("host", [])] not in [[h] for h in self._hosts]:
            return 403, "this server answers to its own address only"
        origins = [f"http://{host}" for host in self._hosts]
        if any(origin.lower() not in origins for origin in headers.get("origin", [])):
            return 403, "requests from other pages are refused"
        site = headers.get("sec-fetch-site", ["none"])[0]
        navigates = headers.get("sec-fetch-mode", ["navigate"])[0] == "navigate"
        if site not in ("none", "same-origin") and not (navigates and scope["path"] == "/"):
            return 403, "requests from other pages are refused"
        if not self._knows_token(scope, headers):
            return 403, "open the address that granufab view has printed, with its token"
        if scope["method"] not in _METHODS:
            return 405, "only GET and HEAD"
        return None

    def _knows_token(self, scope: Scope, headers: Mapping[str, list[str]]) -> bool:
        given = list(headers.get(TOKEN_HEADER, []))
        given += parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])
        for text in headers.get("cookie", []):
            try:
                found = SimpleCookie(text).get(self.cookie)
            except CookieError:
                continue
            given += [] if found is None else [found.value]
        return any(secrets.compare_digest(one.encode(), self._token.encode()) for one in given)

    def _cookie_text(self) -> str:
        return f"{self.cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"


async def _refuse(send: Send, status: int, words: str) -> None:
    body = f"{words}\n".encode()
    headers = {**HEADERS, "content-type": "text/plain; charset=utf-8", "cache-control": "no-store"}
    listed = [(name.encode(), value.encode()) for name, value in headers.items()]
    listed.append((b"content-length", str(len(body)).encode()))
    await send({"type": "http.response.start", "status": status, "headers": listed})
    await send({"type": "http.response.body", "body": body})
