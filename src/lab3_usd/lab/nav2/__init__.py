"""Files of Nav2."""
