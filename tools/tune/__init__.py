"""`ranger-sim tune`: search controller parameters by walking the whole robot."""
