"""What is looked at: the page of a run, pictures, plots."""
