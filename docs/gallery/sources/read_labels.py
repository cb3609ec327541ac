"""
Tomography: a label image
=========================

In a label image of X-ray tomography each voxel holds the number of its grain, 0 between them.
granufab finds centroids, radii of equal volume, and contacts, which are pairs of labels whose
voxels touch. That is noisy: pairs less than a voxel apart seem to touch, so z is too high. The
picture is a numpy file here; TIFF takes ``granufab[ct]``. How large the noise is, and what helps,
is told in :doc:`/formats`.
"""

import tempfile
from itertools import combinations
from pathlib import Path

import numpy as np
from shared_packing import spheres

import granufab as gf
from granufab import plots

# %%
# Draw the spheres of a small packing at 16 voxels a mean diameter, cut at the edge of the image
# as a scan is, and read the image.

packing = spheres(seed=5)
voxels = 16 / (2 * packing.grains.radius.mean())
centre, radius = packing.grains.position * voxels, packing.grains.radius * voxels
size = np.ceil(np.diag(packing.cell.matrix) * voxels).astype(int)
place = np.indices(size).astype(np.float32)
image = np.zeros(size, np.int16)
for number, (middle, reach) in enumerate(zip(centre, radius, strict=True), 1):
    square = sum((place[axis] - middle[axis]) ** 2 for axis in range(3))
    image[square < reach**2] = number
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "labels.npy"
    np.save(path, image)
    run = gf.read(path)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# Grains that lie whole in the image must come back: centres within a fifth of a voxel.

whole = ((centre > radius[:, None]) & (centre < size - 1 - radius[:, None])).all(axis=1)
same = np.searchsorted(state.grains.number, np.flatnonzero(whole) + 1)
shift = np.linalg.norm(state.grains.position[same] - centre[whole], axis=1)
print(f"{whole.sum()} whole grains, largest shift {shift.max():.3f} voxels")
assert shift.max() < 0.2

# %%
# Contacts between whole grains: all that touch are found, and none whose gap is over a voxel.


def pairs(gap: float) -> set[tuple[int, int]]:
    """Pairs of whole grains at most this far apart [voxels], counted without granufab."""
    found = set()
    for i, j in combinations(np.flatnonzero(whole).tolist(), 2):
        if np.linalg.norm(centre[j] - centre[i]) - radius[i] - radius[j] <= gap:
            found.add((i, j))
    return found


listed = {tuple(sorted(pair)) for pair in state.grains.number[state.contacts.pair] - 1}
kept = {(int(i), int(j)) for i, j in listed if whole[i] and whole[j]}
print(f"touching {len(pairs(0))}, listed {len(kept)}, within one voxel {len(pairs(1))}")
assert pairs(0) <= kept <= pairs(1.0)

# %%
# The contacts of the image, all of one width, since there are no forces.

figure = plots.network_3d(state, criterion="listed", up=2).figure
