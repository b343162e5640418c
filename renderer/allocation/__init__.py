"""Allocation rules that run inside a frame: VKB's importance, the budget fill, the lambda of predicted gain curves.

The offline rules, which need the error curves, are the labeller's.
"""
