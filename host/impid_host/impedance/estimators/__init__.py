"""How parameters are estimated: least squares, instruments, output error, and the choice between them.

docs/estimators.md says which is right when.
"""
