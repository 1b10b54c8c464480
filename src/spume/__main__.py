"""The command line as a module: python -m spume."""

from spume.cli import main

if __name__ == "__main__":
    main()
