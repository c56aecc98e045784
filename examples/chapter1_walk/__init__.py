"""The parts of `examples/chapter1.py`: the seed's cells, this package's answers to them, and their pictures."""
