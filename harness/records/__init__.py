"""The records and reports of a run: trace, log book, samples, and the figures of its summary."""
