"""Mutation testing: one small fault at a time is put into a room, and its tests must notice.

`mutants.py` lists the faults that can be put into a source file, `reach.py` (a pytest plugin) notes which test runs
which function, `work.py` makes the copy in which a mutant lives, runs the tests and keeps the results, and
`equivalent.toml` lists mutants that change nothing which could be noticed, each with its reason.
"""
