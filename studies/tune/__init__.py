"""`python -m studies.tune`: search controller parameters by walking the whole robot."""
