"""Meshes that are adapted to results: estimated errors, cells that are refined or put together, states carried over."""
