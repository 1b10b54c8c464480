"""Detection of the free surface."""
