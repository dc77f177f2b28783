"""The weights of `tracker.confidence`: poses of rendered scenes, right and wrong ones, and a model fitted to them."""
