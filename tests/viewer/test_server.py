"""The server: answers to the user's own page alone, never a file, and what it sends is right."""

from __future__ import annotations

import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from looking import Viewer

from granufab.errors import InvalidSettings, MissingData
from granufab.viewer import ViewedRun, frame_buffer, state_data, unpack

HOSTS = (
    "evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "localhost",
    "0.0.0.0:{port}", "127.0.0.1.evil.example:{port}", "localhost.evil.example:{port}",
    "[::1]:{port}", "127.0.0.1:{port}.evil.example", "user@127.0.0.1:{port}", "127.1:{port}",
    "2130706433:{port}", "127.0.0.1:{port}@evil.example", "",
)  # fmt: skip
ORIGINS = (
    "http://evil.example", "https://evil.example", "null", "http://127.0.0.1", "http://localhost",
    "https://127.0.0.1:{port}", "http://127.0.0.1:1", "http://127.0.0.1.evil.example:{port}",
    "http://evil.example:{port}", "http://[::1]:{port}", "file://", "chrome-extension://abcdef",
    "http://user@127.0.0.1:{port}", "http://127.0.0.1:{port}.evil.example", "ws://127.0.0.1:{port}",
)  # fmt: skip
TRAVERSALS = (
    "/../etc/passwd", "/page/../../../../etc/passwd", "/page/..%2f..%2f..%2fetc%2fpasswd",
    "/page/%2e%2e/%2e%2e/etc/passwd", "/page/....//....//etc/passwd", "/page//etc/passwd",
    "//etc/passwd", "/page/..\\..\\etc\\passwd", "/page/%5c..%5c..%5cetc%5cpasswd",
    "/page/..%c0%af..%c0%afetc/passwd", "/page/%252e%252e%252fetc%252fpasswd",
    "/page/index.html/../../server.py", "/page/../server.py", "/page/%00index.html",
    "/page/index.html%00.js", "/page/file:///etc/passwd", "/page/./main.js", "/page/",
    "/page/~root/.ssh/id_rsa", "/api/runs/../../etc/passwd",
)  # fmt: skip


@pytest.mark.parametrize("host", HOSTS)
def test_a_foreign_host_is_refused(viewer: Any, host: str) -> None:
    answer = viewer.get("/api/runs", {"Host": host.format(port=viewer.port)})
    assert answer.status == 403
    assert b"runs" not in answer.body


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_foreign_origin_is_refused(viewer: Any, origin: str) -> None:
    answer = viewer.get("/api/runs", {"Origin": origin.format(port=viewer.port)})
    assert answer.status == 403
    assert b"runs" not in answer.body


def test_there_are_thirty_of_them() -> None:
    assert len(set(HOSTS)) + len(set(ORIGINS)) == 30
    assert len(set(TRAVERSALS)) == 20


@pytest.mark.parametrize("path", TRAVERSALS)
def test_no_path_reaches_a_file(viewer: Any, path: str) -> None:
    answer = viewer.get(path)
    assert answer.status == 404
    assert b"root:" not in answer.body


@pytest.mark.parametrize(
    "path", ["/", "/page/index.html", "/page/plotly.min.js", "/api/runs", "/api/fit", "/nothing"]
)
@pytest.mark.parametrize("token", [None, "", "guess", "ä"])
def test_without_the_token_nothing_is_given(viewer: Any, path: str, token: str | None) -> None:
    answers = [
        viewer.raw(path if token is None else f"{path}?token={'x' if token == 'ä' else token}")
    ]
    if token is not None:
        answers.append(viewer.raw(path, {"X-Granufab-Token": token}))
        answers.append(viewer.raw(path, {"Cookie": f"granufab={token.encode().hex()}"}))
    assert [answer.status for answer in answers] == [403] * len(answers)


def test_the_address_opens_the_page_and_its_cookie_the_rest(viewer: Any) -> None:
    page = viewer.raw(f"/?token={viewer.token}")
    assert page.status == 200
    assert b"<!doctype html>" in page.body.lower()
    cookie, *rules = (part.strip() for part in page.headers["set-cookie"].split(";"))
    assert {"HttpOnly", "SameSite=Strict"} <= set(rules)
    assert viewer.raw("/api/runs", {"Cookie": f"a=b; {cookie}; c=d"}).status == 200
    assert viewer.raw("/", {"Cookie": cookie}).status == 200
    name, _, value = cookie.partition("=")
    assert viewer.raw("/api/runs", {"Cookie": f"{name}={value[:-1]}"}).status == 403


def test_own_origin_and_name_pass(viewer: Any) -> None:
    for host in ("127.0.0.1", "localhost"):
        own = f"{host}:{viewer.port}"
        answer = viewer.get("/api/runs", {"Host": own, "Origin": f"http://{own}"})
        assert answer.status == 200


def test_what_other_pages_embed_or_fetch_is_refused(viewer: Any) -> None:
    for mode, path, status in (
        ("no-cors", "/page/plotly.min.js", 403),
        ("cors", "/api/runs", 403),
        ("navigate", "/api/runs", 403),
        ("navigate", "/", 200),
    ):
        headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": mode}
        assert viewer.get(path, headers).status == status


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PATCH"])
def test_only_reading(viewer: Any, method: str) -> None:
    headers = {"X-Granufab-Token": viewer.token, "Content-Length": "0"}
    assert viewer.raw("/api/runs", headers, method).status == 405


def test_every_answer_forbids_what_it_can(viewer: Any) -> None:
    for answer in (viewer.get("/"), viewer.get("/api/runs"), viewer.get("/x"), viewer.raw("/")):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert not re.search(r"https?:|\*", policy)
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in answer.headers
        assert "server" not in answer.headers


def test_only_this_machine_is_listened_to(viewer: Any) -> None:
    # All of 127/8 is this machine: a server on every address would answer here too.
    other = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    with other, pytest.raises(ConnectionRefusedError):
        other.connect(("127.0.0.2", viewer.port))


def test_answers_are_those_of_the_functions(
    viewer: Any, view_of: Callable[[Path], ViewedRun], run_file: Path
) -> None:
    viewed = view_of(run_file)
    choice = viewed.choice("gap:0.02", "z")
    place = "/api/runs/0/frames/6"
    query = "criterion=gap:0.02&z_definition=z"
    block = viewer.get(f"{place}/packing?{query}")
    assert block.headers["content-type"] == "application/octet-stream"
    direct = unpack(frame_buffer(viewed.frame(6), choice, before=viewed.frame(5)))
    header, arrays = unpack(block.body)
    assert header == {**direct[0], "run": 0, "frame": 6}
    assert all(np.array_equal(arrays[name], direct[1][name]) for name in direct[1])
    found = viewer.get(f"{place}/state?{query}&bins=12").json()
    wanted = state_data(viewed.run, viewed.frame(6), choice, bins=12)
    assert found == {**wanted, "run": 0, "frame": 6}
    assert viewer.get(f"{place}/interval?{query}").json()["gained"] == header["changes"]["gained"]
    assert viewer.get(f"{place}/criterion").json()["force"]["z"]
    assert viewer.get("/api/fit?runs=0").json()["fit"]["z_min"]["value"] > 0
    assert len(viewer.get("/api/runs").json()["runs"]) == 2
    assert viewer.get("/api/runs/1").json()["dimension"] == 3


def test_what_is_held_is_not_sent_again(viewer: Any) -> None:
    for path in ("/api/runs/0/frames/2/packing", "/api/runs/0", "/page/plotly.min.js"):
        first = viewer.get(path)
        again = viewer.get(path, {"If-None-Match": first.headers["etag"]})
        assert (again.status, again.body) == (304, b"")
        assert viewer.get(path, {"If-None-Match": '"other"'}).status == 200
    other = viewer.get("/api/runs/0/frames/2/packing?criterion=gap:0.02").headers["etag"]
    assert other != viewer.get("/api/runs/0/frames/2/packing").headers["etag"]


@pytest.mark.parametrize(
    ("path", "word"),
    [
        ("/api/runs/9", "runs 0..1"),
        ("/api/runs/0/frames/99/state", "frames 0..11"),
        ("/api/runs/0/frames/-1/state", "whole number"),
        (f"/api/runs/0/frames/{'9' * 5000}/state", "whole number"),
        ("/api/runs/0/frames/0/state?criterion=magic", "criterion"),
        ("/api/runs/0/frames/0/state?z_definition=w", "z_definition"),
        ("/api/runs/0/frames/0/state?bins=100000", "bins"),
        ("/api/runs/0/frames/0/criterion?bootstrap=-1", "bootstrap"),
        ("/api/fit?method=guess", "method"),
        ("/api/fit?runs=0,7", "runs"),
        ("/api/runs/0/frames/0/packing?criterion=gap:nan", "gap"),
    ],
)
def test_bad_questions_are_told_in_one_line(viewer: Any, path: str, word: str) -> None:
    answer = viewer.get(path)
    assert answer.status == 422
    assert word in answer.json()["error"]
    assert "\n" not in answer.json()["error"]


def test_a_taken_port_is_told(viewer: Any) -> None:
    from granufab.viewer.server import listen

    with pytest.raises(InvalidSettings, match=f"port {viewer.port}: .*0 for a free one"):
        listen(viewer.port)


@pytest.mark.parametrize("package", ["starlette", "uvicorn", "plotly"])
def test_a_missing_package_is_told(
    package: str, run_file: Path, view_of: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from granufab.viewer import server

    for name in [n for n in sys.modules if n.partition(".")[0] == package]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingData, match=r"install granufab\[view\]"):
        server.serve([view_of(run_file)])


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_verb_prints_one_line_and_ends_when_interrupted(
    run_file: Path, number: signal.Signals
) -> None:
    pytest.importorskip("uvicorn", reason="the server needs the extra view")
    command = "from granufab.cli import main; main()"
    verb = subprocess.Popen(
        [sys.executable, "-c", command, "view", str(run_file), "--port", "0", "--no-browser"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert verb.stdout is not None
        assert select.select([verb.stdout], [], [], 60)[0]
        line = verb.stdout.readline()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{43}\n", line)
        viewer = Viewer(line.strip())
        assert viewer.get("/api/runs/0").json()["frame_count"] == 12
        time.sleep(0.1)
        verb.send_signal(number)
        out, err = verb.communicate(timeout=30)
    finally:
        verb.kill()
    assert (verb.returncode, out, err) == (0, "", "")
