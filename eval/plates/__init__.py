"""Pictures for papers and bug reports, made from a model or a saved run."""
