"""
YADE: spheres as text, with a table of interactions
===================================================

YADE's ``export.text`` writes ``x y z r``, nothing else: contacts are then found by gap. Forces
come from a table that a script in YADE writes in a loop over the interactions, with the columns
``id1 id2 nx ny nz fn``. Given together, both files are tables, so a map says what the columns of
the spheres hold. The cell is in neither; ``cell=`` gives it. See :doc:`/formats`.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from shared_packing import (
    box,
    compared,
    counted,
    counted_by_gap,
    lines,
    parts,
    spheres,
)

import granufab as gf
from granufab import plots
from granufab.io import write

packing = spheres(seed=20)

# %%
# Write both, look at the first lines, and read the spheres alone and then both.

contacts, push = packing.contacts, parts(packing)[0]
table = "id1 id2 nx ny nz fn\n" + lines(contacts.pair, contacts.normal, push)
cell = {"cell": box(packing), "periodic": "xyz"}
columns = {"grains": {"x": 1, "y": 2, "z": 3, "radius": 4}}
with tempfile.TemporaryDirectory() as folder:
    grains, interactions = Path(folder) / "spheres.txt", Path(folder) / "interactions.txt"
    write(packing, grains, format="yade")
    interactions.write_text(table)
    print(*grains.read_text().splitlines()[:3], sep="\n")
    alone = gf.read(grains, **cell).frames[0].packing
    state = gf.read(grains, interactions, format="csv", columns=columns, **cell).frames[0].packing

# %%
# Of the spheres alone the script counts all pairs at most 10⁻³ mean diameters apart again.

found = gf.measure(alone, criterion="gap:0.001", z_definition="z")
assert compared(found, counted_by_gap(packing, 0.001)) < 1e-8

# %%
# With the table, z, a and q/p must be those that numpy counts from the normal forces; twelve
# digits were written.

pushed = replace(packing, contacts=replace(contacts, force=push[:, None] * contacts.normal))
found = gf.measure(state, z_definition="z")
assert compared(found, counted(pushed)) < 1e-8

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
