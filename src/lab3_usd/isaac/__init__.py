"""What Isaac Sim is: node types, events, names, schemas of sensors; one release, no lab."""
