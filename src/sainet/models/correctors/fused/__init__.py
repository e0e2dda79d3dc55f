"""Recurrent predictions in one kernel for a GPU, and their gradients in another.

A step of a small network is so short that starting its thirty operations takes longer
than computing them. Here a block of pushes stays in one kernel from its first step to
its last (Pallas, through Triton).
"""
