"""Sheets of any shape: points, areas, triangles, thickness and density; cuts, holes, inclusions; their pictures."""
