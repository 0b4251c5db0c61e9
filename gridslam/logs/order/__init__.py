"""Stamps: clocks, steps of a clock, order of messages, repeats."""
