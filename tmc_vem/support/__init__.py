"""The ground: errors, validation, files, ranks, time and memory; imports nothing of the rest."""
