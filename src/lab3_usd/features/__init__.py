"""The features: each is a package that says what it adds to the core (see lab3_usd.hooks)."""
