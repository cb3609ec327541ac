"""One step's contact problem as flat arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = ["Problem", "State"]


class Problem(NamedTuple):
    """What is frozen during the solve of one step.

    Attributes:
        first, second: bodies i, j of each contact, shape (contact_count,).
        normal: from i to j [-], shape (contact_count, D).
        length: |branch| [m], shape (contact_count,).
        offset_n, offset_t: velocity offsets b (gap, bounce, imposed flow, spring memory) [m/s],
            shapes (contact_count,), (contact_count, 1 or 3).
        mu: friction coefficient [-], shape (contact_count,).
        softness: ε = 1/(k h²) [1/kg]; 0 is rigid.
        spin_factor: m R²/I, 2 for disks, 5/2 for spheres, 0 where rotation is blocked.
        coupled: whether free cell components other than the dilation exist.
        dilation_weight: 1/(D M) of the free dilation [1/kg m²], else 0.
        weight: 1/M of each free component of L, else 0, shape (D, D).
    """

    first: np.ndarray
    second: np.ndarray
    normal: np.ndarray
    length: np.ndarray
    offset_n: np.ndarray
    offset_t: np.ndarray
    mu: np.ndarray
    softness: float
    spin_factor: float
    coupled: bool
    dilation_weight: float
    weight: np.ndarray


class State(NamedTuple):
    """What the solve changes; velocities always equal v_free + M⁻¹ H P up to round-off.

    Attributes:
        motion: body records, see ``vectors``, shape (body_count, 4 or 8).
        rate: free part of the velocity gradient L, shape (D, D).
        impulse_n: P_n [N s], shape (contact_count,).
        impulse_t: P_t, shape (contact_count, 1 or 3).
    """

    motion: np.ndarray
    rate: np.ndarray
    impulse_n: np.ndarray
    impulse_t: np.ndarray
