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

from granufab.kernels.tracing import choose, larger, smaller, traced
from granufab.kernels.vectors import axpy, norm, norm2, scale, shorten, sub

__all__ = ["cone_defect", "crossed_law", "separate_law", "slide_or_stick"]


@traced
def separate_law(p_n, p_t, u_n, u_t, inverse_n, inverse_t, mu):
    """Exact impulse where normal and tangent do not couple (W_nt = 0).

    Args:
        p_n, p_t: impulse now (number or lanes, tangential tuple) [N s].
        u_n, u_t: velocity with all offsets, at that impulse [m/s].
        inverse_n, inverse_t: 1/(W_nn + ε) and 1/(W_tt + ε) [kg].
        mu: friction coefficient [-].
    Returns:
        The new impulse (p_n, p_t).
    """
    new_n = larger(0.0, p_n - u_n * inverse_n)
    stick = axpy(-1.0 * inverse_t, u_t, p_t)
    return new_n, shorten(stick, mu * new_n)


@traced
def slide_or_stick(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
    """Exact 2D impulse where normal and tangent couple through the cell (W_nt ≠ 0).

    Stick solves the 2×2 system; else sliding in direction s = ±1 with P_t = s µ P_n and
    P_n = −b_n/(W_nn + s µ W_nt); requires W_nn > µ |W_nt|.

    Args:
        p_n, p_t: impulse now (numbers or lanes) [N s].
        u_n, u_t: velocity with all offsets, at that impulse [m/s].
        w_nn, w_nt, w_tt: local Delassus matrix, ε included on the diagonal [1/kg].
        mu: friction coefficient [-].
    """
    b_n = smaller(0.0, u_n - w_nn * p_n - w_nt * p_t)  # 0 where the contact opens: no impulse
    b_t = u_t - w_nt * p_n - w_tt * p_t
    scale_ = 1.0 / (w_nn * w_tt - w_nt * w_nt)
    stick_n = (w_nt * b_t - w_tt * b_n) * scale_
    stick_t = (w_nt * b_n - w_nn * b_t) * scale_
    ahead = b_t - (w_nt + mu * w_tt) * b_n / (w_nn + mu * w_nt)
    side = choose(ahead > 0.0, -1.0, 1.0)
    slide_n = -1.0 * b_n / (w_nn + side * mu * w_nt)
    sticks = abs(stick_t) <= mu * stick_n
    new_n = choose(b_n < 0.0, choose(sticks, stick_n, slide_n), 0.0)
    return new_n, choose(sticks, stick_t, side * mu * slide_n)


@traced
def cone_defect(p_n, p_t, u_n, u_t, rho, mu):
    """Squared distance |P − proj_K(P − ρ(u + µ|u_t| n))|² of one contact from its law.

    K is Coulomb's cone |P_t| ≤ µ P_n; the projection is Euclidean. Zero exactly at solutions
    (De Saxcé's bipotential form); independent of units once divided by ‖P‖².
    """
    trial_n = p_n - rho * (u_n + mu * norm(u_t))
    trial_t = axpy(-1.0 * rho, u_t, p_t)
    size = norm(trial_t)
    edge = larger(0.0, (trial_n + mu * size) / (1.0 + mu * mu))
    inside = size <= mu * trial_n + smaller(0.0, trial_n)
    new_n = choose(inside, trial_n, edge)
    share = choose(inside, 1.0, mu * edge / larger(size, 1e-300))
    change = sub(p_t, scale(share, trial_t))
    return (p_n - new_n) * (p_n - new_n) + norm2(change)


@traced
def crossed_law(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu):
    """:func:`slide_or_stick` for a tangential tuple; there is none in 3D, where W_nt is 0."""
    new_n, new_t = slide_or_stick(p_n, p_t[0], u_n, u_t[0], w_nn, w_nt, w_tt, mu)
    return new_n, (new_t,)
