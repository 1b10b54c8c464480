"""The equations once more, as plain NumPy double loops that know nothing of Spume.

One module per family and one function per scheme, named like it: each returns one value per row of a ``Cloud``.
``tests/claims.toml`` holds a checksum of what they give; ``tests/test_claims.py`` holds the schemes to it.
"""
