"""Which node of a stage plays which role of a spec, what is wrong with its wires."""
