"""Reading the description of a lab from YAML."""
