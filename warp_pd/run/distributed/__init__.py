"""One sheet on several processes, using torch.distributed."""
