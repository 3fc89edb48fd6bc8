"""Rules about graphs, nodes, values and wires."""
