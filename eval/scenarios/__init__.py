"""Does a tracker know when it is lost, and does it come back? Scripted scenes, run and judged frame by frame."""
