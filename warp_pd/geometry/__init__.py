"""Sheets of any shape: points, areas, triangles, thickness, density, cuts, holes, inclusions, and pictures of them."""
