"""
LAMMPS: a data file
===================

A data file holds atoms and the box, no contacts; granufab writes such files too. Which pairs
touch is then found from positions and radii: the criterion ``gap:δ`` counts pairs whose surfaces
are at most δ mean diameters apart. How z depends on δ is the subject of :doc:`/criterion`; the
format is described in :doc:`/formats`.
"""

import tempfile
from pathlib import Path

from shared_packing import compared, counted_by_gap, spheres

import granufab as gf
from granufab import plots
from granufab.io import write

packing = spheres(seed=6)

# %%
# Write the packing, look at the head of the file, read it.

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "grains.data"
    write(packing, path)
    print(*path.read_text().splitlines()[:14], sep="\n")
    state = gf.read(path).frames[0].packing

# %%
# The script counts the pairs again by comparing every two spheres.

found = gf.measure(state, criterion="gap:0.001", z_definition="z")
assert compared(found, counted_by_gap(packing, 0.001)) < 1e-8

# %%
# How z and a of this state depend on δ.

curves = gf.fabric.criterion_curves(state)
figure = plots.criterion_curves(curves)[0].figure
