"""
GSD: HOOMD-blue and freud
=========================

GSD holds a table of names, an index and arrays in single precision; the box is centred. granufab
reads it without the ``gsd`` package. There are no contacts in it: they are found by gap. Single
precision is coarse for that: at a mean diameter of 1 and positions up to 7, about 5·10⁻⁷, which
is why δ is 10⁻³ here and not 0. See :doc:`/formats` and :doc:`/criterion`.
"""

import struct
import tempfile
from pathlib import Path

import numpy as np
from shared_packing import compared, counted_by_gap, edges, spheres

import granufab as gf
from granufab import plots

packing = spheres(seed=4)

# %%
# Write header, names, arrays and index by hand, and read them.

size = edges(packing)
chunks = {
    "configuration/box": np.array([*size, 0, 0, 0], "f4"),
    "particles/N": np.array([packing.grains.count], "u4"),
    "particles/position": (packing.grains.position - 0.5 * size).astype("f4"),
    "particles/diameter": (2 * packing.grains.radius).astype("f4"),
}
data, index = b"", b""
for name, values in enumerate(chunks.values()):
    kind = 3 if values.dtype == "u4" else 9
    rows, width = (*values.shape, 1)[:2]
    index += struct.pack("<QQqIHBB", 0, rows, 512 + len(data), width, name, kind, 0)
    data += values.tobytes()
names = b"".join(name.encode() + b"\0" for name in chunks).ljust(256, b"\0")
head = struct.pack(
    "<QQQQQII64s64s80s", 0x65DF65DF65DF65DF, 512 + len(data), len(chunks) + 2, 256, 4,
    1 << 16 | 4, 2 << 16, b"granufab", b"hoomd", b"",
)  # fmt: skip
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "state.gsd"
    path.write_bytes(head + names + data + index + bytes(64))
    run = gf.read(path)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# The script counts the pairs again in double precision. Pairs within 10⁻⁶ of δ may be counted
# here and not there: z and a within 0.05.

found = gf.measure(state, criterion="gap:0.001", z_definition="z")
assert compared(found, counted_by_gap(packing, 0.001)) < 0.05

# %%
# The contacts that were found; lines are of one width, since there are no forces.

figure = plots.network_3d(state, criterion="gap:0.001").figure
