"""One sheet on several processes, by Torch's distributed package."""
