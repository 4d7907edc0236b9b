"""Contact seen from outside: outlines of solids, distances and overlap in a state."""
