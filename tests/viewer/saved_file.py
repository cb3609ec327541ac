"""A saved page read without a browser: its blocks, and a frame made of them as by the page."""

from __future__ import annotations

import base64
import gzip
import json
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.viewer import unpack

_BLOCK = re.compile(r'<script type="text/plain" id="([^"]*)">([A-Za-z0-9+/=]*)</script>')


class SavedFile:
    """The blocks of a saved page by their ids."""

    def __init__(self, content: bytes) -> None:
        found = _BLOCK.findall(content.decode())
        self.blocks = {name: gzip.decompress(base64.b64decode(text)) for name, text in found}
        assert len(self.blocks) == len(found)
        self.contents: Any = json.loads(self.blocks["saved-contents"])

    def states(self, run: int, frame: int) -> Any:
        return json.loads(self.blocks[f"states-{run}-{frame}"])

    def interval(self, run: int, frame: int) -> Any:
        return unpack(self.blocks[f"changes-{run}-{frame}"])[0]["interval"]

    def frame(
        self, run: int, frame: int, place: int = 0
    ) -> tuple[dict[str, Any], dict[str, NDArray]]:
        """Header and arrays under one of the frame's criteria, as docs/viewer.md tells it."""
        header, saved = unpack(self.blocks[f"frame-{run}-{frame}"])
        _, found = unpack(self.blocks[f"grains-{run}-{header['grains']}"])
        rule, steps, count = header["criteria"][place], header["steps"], header["grain_count"]
        header |= rule
        found["position"] = np.array(header["position_low"]) + saved["position"] * np.array(
            steps["position"]
        )
        for name in ("velocity", "spin"):
            if name in saved:
                found[name] = saved[name] * steps[name]
        found["held"] = bits(saved["held"][place], count)
        pairs = rule["list"]
        first = np.cumsum(saved[f"{pairs}_first"], dtype=saved[f"{pairs}_first"].dtype)
        chosen = _chosen(saved, rule, len(first))
        pair = np.column_stack([first, saved[f"{pairs}_second"]])[chosen].astype(int)
        image = saved[f"{pairs}_image"][chosen]
        branch = found["position"][pair[:, 1]] - found["position"][pair[:, 0]]
        if header["cell"] is not None:
            branch = branch + image @ np.array(header["cell"]["vectors"])
        found |= {"pair": pair, "image": image, "branch": branch}
        found["normal"] = branch / np.linalg.norm(branch, axis=1)[:, None]
        if f"{pairs}_gap" in saved:
            found["gap"] = saved[f"{pairs}_gap"][chosen] * steps[f"{pairs}_gap"]
        if f"{pairs}_force" in saved:
            found["force"] = saved[f"{pairs}_force"][chosen] * steps["force"]
        found["contact_number"] = np.bincount(pair.ravel(), minlength=count)
        if place == 0:
            changes, arrays = unpack(self.blocks[f"changes-{run}-{frame}"])
            header["changes"] = changes["changes"]
            if "gained" in arrays:
                found["gained"] = bits(arrays["gained"], len(pair))
                found["lost_pair"] = arrays["lost_pair"]
        return header, found


def bits(packed: NDArray, count: int) -> NDArray:
    return np.unpackbits(packed, bitorder="little")[:count]


def _chosen(saved: dict[str, NDArray], rule: dict[str, Any], count: int) -> NDArray:
    if rule["kind"] == "listed":
        return np.ones(count, dtype=bool)
    if rule["kind"] == "own":
        return bits(saved[f"{rule['list']}_own"], count) == 1
    number = saved[f"{rule['list']}_{rule['kind']}_levels"]
    beyond = rule["level"] if rule["kind"] == "force" else rule["levels"] - 1 - rule["level"]
    return number > beyond
