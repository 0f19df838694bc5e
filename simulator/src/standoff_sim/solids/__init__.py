"""Triangles: the solids that everything on the site is built from."""
