"""Sheets from outlines, clouds, curved surfaces and files."""
