"""
VTK: points and lines for ParaView
==================================

A pair of VTK PolyData files: grains as points with a radius, contacts as lines with their forces.
granufab writes such pairs for ParaView and reads those of others, whether their arrays are text,
base64 or raw. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

from shared_packing import compared, counted, spheres

import granufab as gf
from granufab import plots
from granufab.io import write

packing = spheres(seed=19)

# %%
# Write the pair, read it.

with tempfile.TemporaryDirectory() as folder:
    files = write(packing, Path(folder) / "state.vtp")
    print(*(path.name for path in files))
    run = gf.read(*files)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; the numbers are doubles.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-12

# %%
# The density of the normal forces, on an axis where an exponential is straight.

forces = gf.fabric.force_statistics(state)
figure = plots.force_density(forces, logarithmic_force=False).figure
