"""What several commands use: options, judging, reporting, watching, baselines."""
