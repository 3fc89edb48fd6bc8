"""Opening untrusted stages without leaving their folder."""
