"""The cell driver: C that loops over cells with the functions of a point, and the arrays it works on."""
