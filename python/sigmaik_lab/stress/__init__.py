"""Random cycles into every limit, on any executor: counts of each property.

Runs the C++ programs sigmaik_stress and sigmaik_settling (built by `make build`), each piece with a seed of its own,
and adds up their tables: how often a property was tried, and how often it failed. A file takes a row for each piece and
property, so that a long run resumes. docs/reliability.md says what is drawn and what is counted.
"""
