"""X' = X hat(u(t)) by Magnus steps of order 4, 6 and 8; see templates/magnus.c."""
