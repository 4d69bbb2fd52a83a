"""The GPU set on a CPU: one variant of each test, so that the tests themselves stay in order."""


def pytest_collection_modifyitems(config, items):
    """Leave out further variants on a CPU: other tests cover the same there, and compiling takes long."""
    kept, left, seen = [], [], set()
    for item in items:
        variant = getattr(item, "callspec", None)
        on_cpu = variant is not None and variant.params.get("device") == "cpu" and "/gpu/" in item.path.as_posix()
        (left if on_cpu and item.originalname in seen else kept).append(item)
        if on_cpu:
            seen.add(item.originalname)
    config.hook.pytest_deselected(items=left)
    items[:] = kept
