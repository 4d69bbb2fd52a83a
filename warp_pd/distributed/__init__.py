"""One sheet on several processes."""
