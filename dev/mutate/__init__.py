"""Mutation testing: one small fault at a time is put into a room, and its tests must notice.

`mutants.py` lists the faults that can be put into a source file, `serve.py` (a pytest plugin) notes which test runs
which function and tries mutants in forked processes, `work.py` makes the copy in which a mutant lives, chooses its
tests and keeps the results, and `equivalent.toml` lists mutants that change nothing which could be noticed, each with
its reason.
"""
