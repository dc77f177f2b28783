"""Measurements of speed: ratios between two ways of the same work, in one run."""
