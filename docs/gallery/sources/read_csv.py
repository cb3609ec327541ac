"""
Tables: CSV with a column map
=============================

Any program can write a table of grains and one of contacts. Usual names of columns are
recognised; for others a map says what they hold, and where a convention differs, such as the body
that a force acts on. On the command line the map is a small TOML file. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import box, compared, counted, disks, lines

import granufab as gf
from granufab import plots

packing = disks(seed=1)

# %%
# Write two tables with names of our own, the forces on the first grain, and read them with a map.

grains, contacts = packing.grains, packing.contacts
grains_text = "who,east,north,size\n" + lines(
    np.arange(grains.count) + 100, grains.position, 2 * grains.radius, mark=","
)
contacts_text = "from,to,fe,fn\n" + lines(contacts.pair + 100, -contacts.force, mark=",")
columns = {
    "grains": {"id": "who", "x": "east", "y": "north", "diameter": "size"},
    "contacts": {"i": "from", "j": "to", "fx": "fe", "fy": "fn"},
    "conventions": {"force_on": "first"},
}
with tempfile.TemporaryDirectory() as folder:
    one, two = Path(folder) / "grains.csv", Path(folder) / "contacts.csv"
    one.write_text(grains_text)
    two.write_text(contacts_text)
    run = gf.read(one, two, columns=columns, cell=box(packing), periodic="xy")
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# The packing that was read; lines are as wide as the normal force.

figure = plots.network(state).figure
