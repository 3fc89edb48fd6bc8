"""Which node of a stage plays which role of a spec, and what is wrong with its wires."""
