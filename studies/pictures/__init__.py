"""The figures of the documentation: `python -m studies.pictures.NAME` draws one again, into docs/."""
