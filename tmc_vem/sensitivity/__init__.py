"""Derivatives of what a run says about a state, with respect to anything that the state depends on."""
