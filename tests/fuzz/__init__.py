"""Damaged files through every reader, faulty frames through the tracker: `python -m tests.fuzz --help`.

A reader may refuse what it is given with a TrackerError that names the file, or take it; nothing else may come out of
it: no other exception, no crash, no hang, no more memory than some pictures of the largest size take. Every input is
made from (seed, reader, number) alone, so that one that was found can be made again.
"""
