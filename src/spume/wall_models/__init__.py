"""How solid rows supply what the fluid misses at a wall."""
