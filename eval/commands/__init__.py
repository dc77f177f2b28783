"""What `python -m eval` can do, a file a command. They import what they need when they are called."""
