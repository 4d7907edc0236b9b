"""Energy on the sides between cells: the interior penalty of the second gradient."""
