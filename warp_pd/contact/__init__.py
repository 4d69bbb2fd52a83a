"""Contact of the sheet with rigid bodies and with itself, and how bodies move."""
