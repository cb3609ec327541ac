"""The server of the viewer: this machine only, behind :class:`granufab.viewer.guard.Guard`."""

from __future__ import annotations

import hashlib
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from importlib import import_module
from typing import Any

from granufab.errors import GranufabError, InvalidSettings, MissingData
from granufab.viewer.answers import Answers
from granufab.viewer.guard import Guard, new_token
from granufab.viewer.page_files import PageFile, page_files
from granufab.viewer.viewed_run import ViewedRun

__all__ = ["HOST", "application", "listen", "serve", "serving"]

HOST = "127.0.0.1"
"""The only address that is listened on."""
_DIGITS = 9
_JSON, _BLOCK = "application/json", "application/octet-stream"


def listen(port: int) -> socket.socket:
    """A socket that listens on this machine alone.

    Args:
        port: 0 for a free one.
    Raises:
        InvalidSettings: the port is taken, or may not be used.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((HOST, port))
        found.listen(128)
    except (OSError, OverflowError) as error:
        found.close()
        reason = getattr(error, "strerror", None) or error
        raise InvalidSettings(f"port {port}: {reason}; give another, or 0 for a free one") from None
    return found


def application(answers: Answers, *, token: str, port: int) -> Any:
    """The ASGI application: routes behind the guard.

    Args:
        answers: about the runs.
        token: that every request must carry.
        port: that the server listens on.
    Raises:
        MissingData: the extra ``view`` is not installed.
    """
    routing, applications = _need("starlette.routing"), _need("starlette.applications")
    route, place = routing.Route, "/api/runs/{run}/frames/{frame}"
    pages = page_files()
    routes = [
        route("/", _page(pages["index.html"])),
        *(route(f"/page/{name}", _page(file)) for name, file in pages.items()),
        route("/api/runs", _asked(answers.listed, _JSON)),
        route("/api/fit", _asked(answers.fit, _JSON)),
        route("/api/runs/{run}", _asked(answers.overview, _JSON)),
        route("/api/runs/{run}/series", _asked(answers.series, _JSON)),
        route(f"{place}/packing", _asked(answers.packing, _BLOCK)),
        route(f"{place}/state", _asked(answers.state, _JSON)),
        route(f"{place}/interval", _asked(answers.interval, _JSON)),
        route(f"{place}/criterion", _asked(answers.criterion, _JSON)),
    ]
    app = applications.Starlette(routes=routes)
    app.router.redirect_slashes = False
    return Guard(app, token=token, port=port)


def serve(
    runs: Sequence[ViewedRun],
    *,
    port: int = 0,
    started: Callable[[str], None] = print,
) -> None:
    """Serve runs until the process is interrupted.

    Args:
        runs: what is looked at.
        port: 0 for a free one.
        started: is given the address, token included, once connections are accepted.
    Raises:
        MissingData: the extra ``view`` is not installed.
        InvalidSettings: the port is taken.
    """
    with closing(listen(port)) as heard:
        server, address = _server(runs, heard)
        started(address)
        server.run(sockets=[heard])


@contextmanager
def serving(runs: Sequence[ViewedRun], *, port: int = 0) -> Iterator[str]:
    """Serve runs from a thread of this process while the block runs; gives the address.

    Raises:
        MissingData, InvalidSettings: as for :func:`serve`.
    """
    with closing(listen(port)) as heard:
        server, address = _server(runs, heard)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [heard]}, daemon=True)
        thread.start()
        try:
            yield address
        finally:
            server.should_exit = True
            thread.join(timeout=10)


def _server(runs: Sequence[ViewedRun], heard: socket.socket) -> tuple[Any, str]:
    uvicorn = _need("uvicorn")
    token, port = new_token(), heard.getsockname()[1]
    app = application(Answers(runs), token=token, port=port)
    config = uvicorn.Config(
        app, log_level="error", access_log=False, lifespan="off", server_header=False,
        proxy_headers=False, ws="none", timeout_graceful_shutdown=2,
    )  # fmt: skip
    return uvicorn.Server(config), f"http://{HOST}:{port}/?token={token}"


def _page(file: PageFile) -> Callable[[Any], Any]:
    tag = _tag(file.content)

    def answer(request: Any) -> Any:
        return _answer(request, file.content, file.type, tag)

    return answer


def _asked(answer: Callable[..., bytes], kind: str) -> Callable[[Any], Any]:
    """An endpoint, run in a thread of the server: numbers in the path, the rest as text."""

    def endpoint(request: Any) -> Any:
        try:
            place = {name: _number(name, text) for name, text in request.path_params.items()}
            content = answer(**place, query=request.query_params)
        except GranufabError as error:
            return _told(error)
        return _answer(request, content, kind, _tag(content))

    return endpoint


def _number(name: str, text: str) -> int:
    if not (text.isascii() and text.isdigit()) or len(text) > _DIGITS:
        raise InvalidSettings(f"{name} is {text[:40]!r}, must be a whole number")
    return int(text)


def _told(error: GranufabError) -> Any:
    """A message in one line: 422 for what was asked wrongly or is not there, else 500."""
    responses = _need("starlette.responses")
    status = 422 if isinstance(error, ValueError) else 500
    words = " ".join(str(error).split())
    return responses.JSONResponse({"error": words}, status, {"cache-control": "no-store"})


def _answer(request: Any, content: bytes, kind: str, tag: str) -> Any:
    """The content, or 304 where the browser holds it already."""
    responses = _need("starlette.responses")
    headers = {"etag": tag, "cache-control": "private, no-cache"}
    if tag in [one.strip() for one in request.headers.get("if-none-match", "").split(",")]:
        return responses.Response(status_code=304, headers=headers)
    return responses.Response(content, media_type=kind, headers=headers)


def _tag(content: bytes) -> str:
    return f'"{hashlib.blake2b(content, digest_size=16).hexdigest()}"'


def _need(module: str) -> Any:
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise MissingData(
            f"the viewer needs the package {package}; install granufab[view]"
        ) from None
