"""Configuration files: settings for all commands, beside the stages."""
