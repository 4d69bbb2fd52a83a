"""Comparisons with what other people measured or computed; docs/validation.md."""
