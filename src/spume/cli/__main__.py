"""The command line as a module: python -m spume.cli."""

from spume.cli import main

main()
