"""Spreading a mesh over the ranks."""
