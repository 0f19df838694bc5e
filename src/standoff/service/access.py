"""Who may ask: the browser that opened the address which was printed on this machine, and nobody else."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Collection
from http.cookies import CookieError, SimpleCookie
from typing import Final
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE: Final = "standoff"
_LOCAL: Final = frozenset({"127.0.0.1", "localhost"})
_READS: Final = frozenset({"GET", "HEAD"})
_HEADERS: Final = {
    # Nothing from elsewhere, nothing inline: a page that shows file names and comments must not run them.
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' blob: data:; "
        "media-src 'self' blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Access:
    """Let in who has opened the address with the token; the token opens once, a cookie keeps the door open.

    Pages of other sites can make a browser ask any address, this machine's as well. They can neither read the cookie
    nor send it (SameSite), and a name of theirs that points here is refused by its `Host`.

    Args:
        app: What is guarded.
        token: The secret of the address.
        opens_once: False: as often as somebody has it, and cookies outlive a restart that keeps it.
        open_paths: What anybody on this machine may ask.
    """

    def __init__(self, app: ASGIApp, token: str, *, opens_once: bool = True, open_paths: Collection[str] = ()) -> None:
        self._app = app
        self._token: str | None = token
        self._opens_once, self._open_paths = opens_once, frozenset(open_paths)
        self._session = secrets.token_urlsafe(32) if opens_once else hashlib.sha256(token.encode()).hexdigest()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        answer = self._refusal(scope) or self._opening(scope)
        if answer is None and scope["path"] not in self._open_paths and not self._is_known(scope):
            answer = PlainTextResponse("Open the address that `standoff` printed: it opens once.", status_code=403)
        guarded = _with_headers(send)
        await (self._app if answer is None else answer)(scope, receive, guarded)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if host.rpartition(":")[0] not in _LOCAL:
            return PlainTextResponse("This page answers on this machine only.", status_code=403)
        origin = headers.get("origin")
        if scope["method"] not in _READS and origin not in (None, f"http://{host}"):
            return PlainTextResponse("Another page may not change anything here.", status_code=403)
        return None

    def _opening(self, scope: Scope) -> Response | None:
        """Exchange the token of the address for a cookie; the address without it is what the browser remembers."""
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if scope["path"] != "/" or not given or self._token is None:
            return None
        if not secrets.compare_digest(given.encode(), self._token.encode()):
            return None
        if self._opens_once:
            self._token = None
        answer = RedirectResponse("/", status_code=303)
        answer.set_cookie(COOKIE, self._session, httponly=True, samesite="strict", path="/")
        return answer

    def _is_known(self, scope: Scope) -> bool:
        try:
            cookies = SimpleCookie(Headers(scope=scope).get("cookie", ""))
        except CookieError:
            return False
        session = cookies.get(COOKIE)
        return session is not None and secrets.compare_digest(session.value.encode(), self._session.encode())


def _with_headers(send: Send) -> Send:
    async def sends(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers[name] = value
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return sends
