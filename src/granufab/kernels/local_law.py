"""One contact of a problem (W, q, mu) solved exactly, W_nt ≠ 0 included, and a sweep over all.

With b the velocity of the contact without its own impulse, u = W r + b. No impulse where
b_n ≥ 0. Else u_n = 0 gives r_n = −b_n/W_nn − k·r_t with k = W_tn/W_nn, and the tangential
part is S r_t − c = u_t, S = W_tt − W_tn W_nt/W_nn, c = k b_n − b_t. Sliding means u_t = −α r_t
with α ≥ 0, so

    r_t(α) = (S + α)⁻¹ c,        |r_t(α)| = µ r_n(α),

one equation for the number α (α = 0 where the contact sticks). From beyond the cone at α = 0,
r_t falls to 0 and r_n rises to −b_n/W_nn > 0, so a root always exists. In the eigenvectors of S
r_t(α) is a division by λ + α; 2D is the case of one eigenvector.
"""

from __future__ import annotations

import math

import numpy as np

from granufab.kernels.options import kernel

__all__ = ["local_frames", "solve_contact", "sweep_contacts"]

FLOOR = 1e-14
ROOT_STEPS = 80


@kernel
def local_frames(blocks, dimension):
    """What :func:`solve_contact` needs of every diagonal block.

    Args:
        blocks: W_aa [1/kg], shape (contact_count, d, d).
        dimension: d.
    Returns:
        Rows (W_nn, k_1, k_2, λ_1, λ_2, cos, sin), shape (contact_count, 7): k and the eigenvalues
        of S in its eigenvectors (cos, sin), (−sin, cos) [-, 1/kg]; in 2D k_2 = 0, λ_2 = 1.
    """
    frames = np.zeros((len(blocks), 7))
    for c in range(len(blocks)):
        w = blocks[c]
        w_n = w[0, 0]
        k_1, k_2 = w[1, 0] / w_n, 0.0
        s_11 = w[1, 1] - k_1 * w[0, 1]
        low, high, cosine, sine = s_11, 1.0, 1.0, 0.0
        floor = FLOOR * (w_n + w[1, 1])
        if dimension == 3:
            k_2 = w[2, 0] / w_n
            s_12 = w[1, 2] - k_1 * w[0, 2]
            s_22 = w[2, 2] - k_2 * w[0, 2]
            angle = 0.5 * math.atan2(2.0 * s_12, s_11 - s_22)
            cosine, sine = math.cos(angle), math.sin(angle)
            middle, half = 0.5 * (s_11 + s_22), math.hypot(0.5 * (s_11 - s_22), s_12)
            low, high = middle + half, middle - half
            k_1, k_2 = cosine * k_1 + sine * k_2, cosine * k_2 - sine * k_1
            floor += FLOOR * w[2, 2]
        frames[c, 0], frames[c, 1], frames[c, 2] = w_n, k_1, k_2
        frames[c, 3], frames[c, 4] = max(low, floor), max(high, floor)
        frames[c, 5], frames[c, 6] = cosine, sine
    return frames


@kernel
def on_ray(alpha, b_n, c_1, c_2, frame):
    """(r_n, r_1, r_2) at u_n = 0 and u_t = −α r_t, in the eigenvectors of S."""
    r_1, r_2 = c_1 / (frame[3] + alpha), c_2 / (frame[4] + alpha)
    return -b_n / frame[0] - frame[1] * r_1 - frame[2] * r_2, r_1, r_2


@kernel
def excess(alpha, b_n, c_1, c_2, frame, mu):
    """µ r_n/|r_t| − 1 on the ray: negative beyond the cone, close to linear in α."""
    r_n, r_1, r_2 = on_ray(alpha, b_n, c_1, c_2, frame)
    return mu * r_n / max(math.hypot(r_1, r_2), 1e-300) - 1.0


@kernel
def slide(b_n, c_1, c_2, frame, mu):
    """The root α by the Illinois variant of the false position, from a bracket."""
    low, high = 0.0, math.hypot(c_1, c_2) * frame[0] / (-b_n * mu) + frame[3] + frame[4]
    f_low = excess(low, b_n, c_1, c_2, frame, mu)
    f_high = excess(high, b_n, c_1, c_2, frame, mu)
    while f_high < 0.0 and high < 1e300:
        low, f_low = high, f_high
        high *= 4.0
        f_high = excess(high, b_n, c_1, c_2, frame, mu)
    alpha = high
    for _ in range(ROOT_STEPS):
        alpha = (low * f_high - high * f_low) / (f_high - f_low)
        f = excess(alpha, b_n, c_1, c_2, frame, mu)
        if abs(f) < 4e-16 or high - low <= 4e-16 * high:
            break
        if f < 0.0:
            low, f_low = alpha, f
            f_high *= 0.5
        else:
            high, f_high = alpha, f
            f_low *= 0.5
    return alpha


@kernel
def solve_contact(b_n, b_1, b_2, frame, mu):
    """Exact impulse (r_n, r_1, r_2) of one contact [N s].

    Args:
        b_n, b_1, b_2: velocity without the contact's own impulse [m/s]; b_2 = 0 in 2D.
        frame: its row of :func:`local_frames`; W_nn > 0.
        mu: friction coefficient [-].
    """
    if b_n >= -1e-300:
        return 0.0, 0.0, 0.0
    if mu == 0.0:
        return -b_n / frame[0], 0.0, 0.0
    cosine, sine = frame[5], frame[6]
    c_1 = frame[1] * b_n - (cosine * b_1 + sine * b_2)
    c_2 = frame[2] * b_n - (cosine * b_2 - sine * b_1)
    r_n, r_1, r_2 = on_ray(0.0, b_n, c_1, c_2, frame)
    if math.hypot(r_1, r_2) > mu * r_n:
        alpha = slide(b_n, c_1, c_2, frame, mu)
        r_n, r_1, r_2 = on_ray(alpha, b_n, c_1, c_2, frame)
    return r_n, cosine * r_1 - sine * r_2, sine * r_1 + cosine * r_2


@kernel
def sweep_contacts(starts, columns, blocks, frames, q, mu, impulse):
    """One Gauss–Seidel sweep over all contacts of a problem in block rows.

    Args:
        starts, columns: of the block rows, as in a BSR matrix.
        blocks: W_ab [1/kg], shape (block_count, d, d).
        frames: from :func:`local_frames`.
        q: velocities without impulses [m/s], shape (contact_count, d).
        mu: friction coefficients [-], shape (contact_count,).
        impulse: r [N s], shape (contact_count, d); replaced.
    Returns:
        Σ|Δr|² [N² s²].
    """
    dimension = q.shape[1]
    b, new = np.zeros(3), np.zeros(3)
    moved = 0.0
    for a in range(len(mu)):
        for k in range(dimension):
            b[k] = q[a, k]
        for at in range(starts[a], starts[a + 1]):
            other = columns[at]
            if other != a:
                for k in range(dimension):
                    for l in range(dimension):
                        b[k] += blocks[at, k, l] * impulse[other, l]
        new[0], new[1], new[2] = solve_contact(b[0], b[1], b[2], frames[a], mu[a])
        for k in range(dimension):
            change = new[k] - impulse[a, k]
            moved += change * change
            impulse[a, k] = new[k]
    return moved
