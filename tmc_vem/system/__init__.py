"""What a discretisation is to everything above it, and what both discretisations share."""
