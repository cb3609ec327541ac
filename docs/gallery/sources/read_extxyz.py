"""
Extended XYZ: OVITO and ASE
===========================

Extended XYZ has the cell and the names of its columns in the second line; OVITO and ASE read and
write it. granufab writes it too. There are no contacts: they are found by gap, here of at most
10⁻³ mean diameters. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

from shared_packing import compared, counted_by_gap, spheres

import granufab as gf
from granufab import plots
from granufab.io import write

packing = spheres(seed=3)

# %%
# Write the packing, look at the first lines, read it.

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "state.xyz"
    write(packing, path)
    print(*path.read_text().splitlines()[:3], sep="\n")
    state = gf.read(path).frames[0].packing

# %%
# The script counts the pairs again by comparing every two spheres.

found = gf.measure(state, criterion="gap:0.001", z_definition="z")
assert compared(found, counted_by_gap(packing, 0.001)) < 1e-8

# %%
# How z and a of this state depend on δ.

curves = gf.fabric.criterion_curves(state)
figure = plots.criterion_curves(curves)[0].figure
