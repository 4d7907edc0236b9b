"""Numbers of the documentation: which block of which page is made from which runs, and what it says."""
