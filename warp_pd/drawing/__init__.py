"""Pictures of shapes, and the files that all pictures go to."""
