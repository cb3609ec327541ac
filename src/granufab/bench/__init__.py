"""How fast the engine is, side by side with a plain C++ sweep and with plain Gauss–Seidel."""
