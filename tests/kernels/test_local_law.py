"""The exact solution at one contact with coupled normal and tangent, against the law itself."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.kernels.contact_law import slide_or_stick
from granufab.kernels.local_law import local_frames, solve_contact, sweep_contacts


def _solve(W: np.ndarray, b: np.ndarray, mu: float) -> np.ndarray:
    frame = local_frames(np.ascontiguousarray(W[None]), len(b))[0]
    full = np.zeros(3)
    full[: len(b)] = b
    return np.array(solve_contact(*full, frame, mu))[: len(b)]


def _assert_law(W: np.ndarray, b: np.ndarray, mu: float, r: np.ndarray) -> str:
    """Check Signorini and Coulomb directly; says which branch it is."""
    u = W @ r + b
    speed, push = np.abs(b).max(), max(np.abs(r).max(), 1e-300)
    assert u[0] >= -1e-11 * speed
    assert r[0] >= 0
    shear, slip = np.linalg.norm(r[1:]), np.linalg.norm(u[1:])
    assert shear <= mu * r[0] + 1e-11 * push
    if r[0] == 0:
        assert not r.any()
        return "open"
    assert abs(u[0]) <= 1e-11 * speed
    if slip <= 1e-10 * speed:
        return "stick"
    assert shear == pytest.approx(mu * r[0], rel=1e-10)
    assert r[1:] @ u[1:] == pytest.approx(-shear * slip, rel=1e-9)
    return "slide"


@pytest.mark.parametrize("dimension", [2, 3])
def test_random_coupled_blocks(dimension: int) -> None:
    rng = np.random.default_rng(dimension)
    met = {"open": 0, "stick": 0, "slide": 0}
    steep = 0
    for _ in range(600):
        arm = rng.standard_normal((dimension, dimension + 2))
        arm[0] *= rng.choice([0.2, 1.0])
        W, b, mu = arm @ arm.T, rng.standard_normal(dimension), rng.uniform(0.05, 1.5)
        met[_assert_law(W, b, mu, _solve(W, b, mu))] += 1
        steep += W[0, 0] < mu * np.linalg.norm(W[0, 1:])
    assert min(met.values()) > 50
    assert steep > 100  # where sliding towards the coupling would ask for a pull


def test_agrees_with_the_closed_form_of_the_engine() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
        arm = rng.standard_normal((2, 4))
        W, b = arm @ arm.T, rng.standard_normal(2)
        mu = 0.9 * rng.uniform() * W[0, 0] / abs(W[0, 1])
        closed = slide_or_stick(0.0, 0.0, b[0], b[1], W[0, 0], W[0, 1], W[1, 1], mu)
        assert _solve(W, b, mu) == pytest.approx(closed, rel=1e-9, abs=1e-12)


def test_isotropic_block_slides_against_the_velocity() -> None:
    """W = w: r_n = −b_n/w, r_t = −µ r_n b_t/|b_t| where |b_t| > µ |b_n|."""
    r = _solve(np.eye(3) * 2.0, np.array([-1.0, 0.9, -1.2]), 0.4)
    assert r == pytest.approx([0.5, -0.2 * 0.6, 0.2 * 0.8], rel=1e-12)


def test_no_friction_and_no_tangential_mobility() -> None:
    W = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 0.0]])
    assert _solve(W, np.array([-1.0, 3.0, 1.0]), 0.0) == pytest.approx([0.5, 0.0, 0.0])
    b = np.array([-1.0, 0.0, 1.0])
    r = _solve(W, b, 0.3)
    assert _assert_law(W, b, 0.3, r) == "slide"
    assert r[2] < 0  # friction opposes a slip that it cannot stop


def test_a_sweep_over_contacts_that_do_not_meet_is_the_solution() -> None:
    rng = np.random.default_rng(3)
    arm = rng.standard_normal((4, 3, 5))
    blocks = np.einsum("aik,ajk->aij", arm, arm)
    q, mu = rng.standard_normal((4, 3)), np.full(4, 0.5)
    impulse = np.zeros((4, 3))
    starts, columns = np.arange(5), np.arange(4)
    frames = local_frames(blocks, 3)
    moved = sweep_contacts(starts, columns, blocks, frames, q, mu, impulse)
    assert moved == pytest.approx((impulse**2).sum())
    for k in range(4):
        assert impulse[k] == pytest.approx(_solve(blocks[k], q[k], 0.5), abs=1e-15)
    assert sweep_contacts(starts, columns, blocks, frames, q, mu, impulse) == 0.0
