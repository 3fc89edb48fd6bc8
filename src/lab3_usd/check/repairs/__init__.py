"""Says how to repair what rules found: a finding and the spec give the edits."""
