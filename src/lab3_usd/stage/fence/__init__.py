"""Opening the stages of strangers without leaving their folder."""
