"""`ranger-sim new`: a project for a user's own machine, written from the `.j2` files in this package."""
