"""Geometry: points, areas and triangles of sheets of any shape, before thickness and density."""
