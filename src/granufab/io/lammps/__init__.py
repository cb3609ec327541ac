"""Parts of the readers of LAMMPS and LIGGGHTS files."""
