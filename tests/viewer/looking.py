"""A server that looks at runs, and requests to it byte for byte as given."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import pytest

from granufab.viewer import ViewedRun


@dataclass(frozen=True)
class Answer:
    """What the server sent."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    def json(self) -> Any:
        return json.loads(self.body)


@dataclass(frozen=True)
class Viewer:
    """A server that runs; requests go out byte for byte as given."""

    address: str

    @property
    def port(self) -> int:
        port = urlsplit(self.address).port
        assert port is not None
        return port

    @property
    def token(self) -> str:
        return self.address.rpartition("token=")[2]

    def raw(self, path: str, headers: Mapping[str, str] = {}, method: str = "GET") -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        connection.putrequest(method, path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        reply = connection.getresponse()
        found = Answer(reply.status, {k.lower(): v for k, v in reply.getheaders()}, reply.read())
        connection.close()
        return found

    def get(self, path: str, headers: Mapping[str, str] = {}) -> Answer:
        return self.raw(path, {"X-Granufab-Token": self.token, **headers})


@contextmanager
def looking_at(*runs: ViewedRun) -> Iterator[Viewer]:
    for module in ("starlette", "uvicorn", "plotly"):
        pytest.importorskip(module, reason="the server needs the extra view")
    from granufab.viewer.server import serving

    with serving(runs) as address:
        yield Viewer(address)
