"""Numba kernels on numbers and arrays. Read ``contact_law`` first; only ``vectors`` knows D."""
