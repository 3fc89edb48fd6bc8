"""The commands of `lab3`, one module each; the only place that prints."""
