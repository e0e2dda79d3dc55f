"""Gymnasium environments of the closed loop (extra `gym`), and policies for them."""
