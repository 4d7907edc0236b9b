"""Mutation runs: small faults put into the sources one at a time, and the tests near them that should see each.

``make mutants`` is the command; docs/mutation.md says how it works.
"""
