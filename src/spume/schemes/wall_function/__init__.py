"""The stress of a boundary layer that is thinner than a particle."""
