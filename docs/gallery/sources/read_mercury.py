"""
MercuryDPM: data and fstat
==========================

A series is ``NAME.data`` (grains) with ``NAME.fstat`` (contacts), matched by time. The fstat
lists a pair of grains twice, from both sides, with the normal towards the first grain and the
forces on it; granufab counts each pair once. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import (
    compared,
    counted,
    edges,
    lines,
    parts,
    points,
    spheres,
)

import granufab as gf
from granufab import plots

packing = spheres(seed=12)

# %%
# Write both files, read them together, and print what was said of them.

grains, contacts = packing.grains, packing.contacts
push, across = parts(packing)
size = np.linalg.norm(across, axis=1)
along = across / np.where(size > 0, size, 1)[:, None]
upper = " ".join(f"{edge:.12g}" for edge in edges(packing))
data_text = f"{grains.count} {packing.time:g} 0 0 0 {upper}\n" + lines(
    grains.position, "0 0 0", grains.radius, "0 0 0 0 0 0 0"
)
fstat_text = f"# {packing.time:g} 0\n# 0 0 0 {upper}\n# 0.4 0.6 0 0 0 0\n"
for sign, pair in ((-1, contacts.pair), (1, contacts.pair[:, ::-1])):
    fstat_text += lines(
        f"{packing.time:g}", pair, points(packing), -contacts.gap, 0, push, size,
        sign * contacts.normal, sign * along,
    )  # fmt: skip
with tempfile.TemporaryDirectory() as folder:
    data, fstat = Path(folder) / "shear.data", Path(folder) / "shear.fstat"
    data.write_text(data_text)
    fstat.write_text(fstat_text)
    run = gf.read(data, fstat)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# The density of the normal forces that were read.

figure = plots.force_density(gf.fabric.force_statistics(state)).figure
