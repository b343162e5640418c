"""Allocation rules that run inside a frame: VKB's importance, the budget fill, the whole bins of predicted prices.

The offline rules, which need the error curves, are the labeller's.
"""
