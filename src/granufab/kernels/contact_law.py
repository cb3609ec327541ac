"""The contact law: Signorini's condition and Coulomb friction, solved exactly at one contact.

Unknown is the impulse P = P_n n + P_t of one step; everything else is frozen, so the relative
velocity after the step is affine in P, u(P) = u + W (P − P_now). The law asks

    0 ≤ u_n + b_n + ε P_n ⟂ P_n ≥ 0,        |P_t| ≤ µ P_n,  friction opposes u_t + b_t + ε P_t,

where b_n holds the gap over the step, the bounce and the imposed flow, and ε = 1/(k h²) is an
implicit spring (0: rigid). The callers pass velocities that already contain b and ε P.

With W_nt = 0 (disks and spheres, uniform dilation) the exact solution is a projection; with a
stress-driven shape of the cell W_nt ≠ 0 and the 2D solution is one of three closed forms.
"""

from __future__ import annotations

from numba.extending import overload

from granufab.kernels.options import ARITHMETIC, kernel
from granufab.kernels.vectors import axpy, norm, norm2, scale, sub

__all__ = ["cone_defect", "coupled_law", "separate_law", "slide_or_stick"]


@kernel
def separate_law(p_n, p_t, u_n, u_t, w_n, w_t, mu):
    """Exact impulse where normal and tangent do not couple (W_nt = 0).

    Args:
        p_n, p_t: impulse now (scalar, tangential tuple) [N s].
        u_n, u_t: velocity with all offsets, at that impulse [m/s].
        w_n, w_t: W_nn + ε and W_tt + ε [1/kg].
        mu: friction coefficient [-].
    Returns:
        The new impulse (p_n, p_t).
    """
    new_n = max(0.0, p_n - u_n / w_n)
    stick = axpy(-1.0 / w_t, u_t, p_t)
    share = min(1.0, mu * new_n / max(norm(stick), 1e-300))
    return new_n, scale(share, stick)


@kernel
def slide_or_stick(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
    """Exact 2D impulse where normal and tangent couple through the cell (W_nt ≠ 0).

    Stick solves the 2×2 system; else sliding in direction s = ±1 with P_t = s µ P_n and
    P_n = −b_n/(W_nn + s µ W_nt); requires W_nn > µ |W_nt|.

    Args:
        p_n, p_t: impulse now (scalars) [N s].
        u_n, u_t: velocity with all offsets, at that impulse (scalars) [m/s].
        w_nn, w_nt, w_tt: local Delassus matrix, ε included on the diagonal [1/kg].
        mu: friction coefficient [-].
    """
    b_n = u_n - w_nn * p_n - w_nt * p_t
    b_t = u_t - w_nt * p_n - w_tt * p_t
    if b_n >= 0.0:
        return 0.0, 0.0
    determinant = w_nn * w_tt - w_nt * w_nt
    stick_n = (w_nt * b_t - w_tt * b_n) / determinant
    stick_t = (w_nt * b_n - w_nn * b_t) / determinant
    if abs(stick_t) <= mu * stick_n:
        return stick_n, stick_t
    side = 1.0
    slide_n = -b_n / (w_nn + mu * w_nt)
    if b_t + (w_nt + mu * w_tt) * slide_n > 0.0:
        side = -1.0
        slide_n = -b_n / (w_nn - mu * w_nt)
    return slide_n, side * mu * slide_n


@kernel
def cone_defect(p_n, p_t, u_n, u_t, rho, mu):
    """Squared distance |P − proj_K(P − ρ(u + µ|u_t| n))|² of one contact from its law.

    K is Coulomb's cone |P_t| ≤ µ P_n; the projection is Euclidean. Zero exactly at solutions
    (De Saxcé's bipotential form); independent of units once divided by ‖P‖².
    """
    trial_n = p_n - rho * (u_n + mu * norm(u_t))
    trial_t = axpy(-rho, u_t, p_t)
    size = norm(trial_t)
    if trial_n >= 0.0 and size <= mu * trial_n:
        new_n = trial_n
        new_t = trial_t
    elif mu * size <= -trial_n:
        new_n = 0.0
        new_t = scale(0.0, trial_t)
    else:
        new_n = (trial_n + mu * size) / (1.0 + mu * mu)
        new_t = scale(mu * new_n / size, trial_t)
    change = sub(p_t, new_t)
    return (p_n - new_n) ** 2 + norm2(change)


def coupled_law(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
    """Exact 2D law with W_nt ≠ 0 (:func:`slide_or_stick`); in 3D :func:`separate_law`.

    In 3D the coupling through the cell is O(1/grain_count) and converges with the sweeps; the
    fixed point is the same.
    """
    if len(p_t) == 1:
        new_n, new_t = slide_or_stick(p_n, p_t[0], u_n, u_t[0], w_nn, w_nt, w_tt, mu)
        return new_n, (new_t,)
    return separate_law(p_n, p_t, u_n, u_t, w_nn, w_tt, mu)


@overload(coupled_law, jit_options=ARITHMETIC)  # type: ignore[arg-type]
def _coupled_law(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
    def disk(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
        new_n, new_t = slide_or_stick(p_n, p_t[0], u_n, u_t[0], w_nn, w_nt, w_tt, mu)
        return new_n, (new_t,)

    def sphere(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
        return separate_law(p_n, p_t, u_n, u_t, w_nn, w_tt, mu)

    return disk if p_t.count == 1 else sphere
