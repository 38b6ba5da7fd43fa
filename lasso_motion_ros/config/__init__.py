"""The parameter table, its validation, and the files made from it."""
