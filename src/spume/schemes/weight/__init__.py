"""Weight functions W(r, re): how much a neighbour at distance r counts."""
