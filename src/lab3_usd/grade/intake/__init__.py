"""Finding the students and their files, in folders, archives and at addresses."""
