"""Treatment of particles that come too close."""
