"""Mesh files: a reader for every format makes a :class:`~tmc_vem.mesh.files.record.Record`, one place a mesh of it."""
