"""The validation cases: a file each, whose ``STUDY`` is found by the file's name."""
