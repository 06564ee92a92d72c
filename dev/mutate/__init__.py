"""Mutation testing: one small fault at a time is put into a package, and its tests must detect it.

`mutants.py` lists the faults that can be put into a source file, `serve.py` (a pytest plugin) notes which test runs
which function and tries mutants in forked processes, `work.py` makes the copy in which a mutant lives, chooses its
tests and keeps the results, and `equivalent.toml` lists mutants without a detectable effect, each with its reason.
"""
