"""What OpenUSD's own validators find, one rule for each of them (`--native`)."""
