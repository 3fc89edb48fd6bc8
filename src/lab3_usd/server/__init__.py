"""A language server: findings, manuals, repairs and places in an editor, as one types."""
