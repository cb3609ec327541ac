"""
ON-DEM: VTKHDF
==============

The ON-DEM draft stores spheres as points of VTKHDF, which ParaView opens, with interactions
beside them; its normal force is positive in traction. granufab writes and reads it, with the
cell, so a state goes out and comes back complete. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import h5py
from shared_packing import compared, counted, spheres

import granufab as gf
from granufab import plots
from granufab.io import write

packing = spheres(seed=18)

# %%
# Write the packing, list what the file holds, read it.

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "state.vtkhdf"
    write(packing, path)
    with h5py.File(path) as file:
        print(*file["VTKHDF/PointData"], "|", *file["ONDEM/Interactions"])
    state = gf.read(path).frames[0].packing

# %%
# z, a and q/p must be those that numpy counts in the packing; the numbers are doubles.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-12

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
