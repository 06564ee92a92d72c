"""What a run keeps and what is told of it: trace, log book, samples, and the figures of its summary."""
