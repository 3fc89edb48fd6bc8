"""Points, by the rubric."""
