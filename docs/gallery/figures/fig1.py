"""
Figure 1: contact networks
==========================

Disks and spheres after a strain of 0.3: lines between touching grains, as wide as the normal
force. The full size is in :doc:`/figures`; how to draw such a network of your own data is in
:doc:`/start`.
"""

from shared_size import small

numbers, picture = small("fig1")

# %%
# The state that is drawn: z without rattlers and the signed anisotropy. Samples of 300 grains of
# three seeds gave z = 3.16 to 3.18 (disks) and 4.25 to 4.34 (spheres) and a' = 0.19 to 0.28;
# asserted are bands of about twice that width.

bands = {"disks": (3.0, 3.35), "spheres": (4.05, 4.55)}
for name, (low, high) in bands.items():
    state = numbers["states"][name]
    print(f"{name}: z {state['z_backbone']:.3f}, a' {state['a_signed']:.3f}")
    assert low < state["z_backbone"] < high
    assert 0.1 < state["a_signed"] < 0.4
