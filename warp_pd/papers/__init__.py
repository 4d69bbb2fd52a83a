"""The force laws of the papers beside the bond-associated one, and what belongs to them."""
