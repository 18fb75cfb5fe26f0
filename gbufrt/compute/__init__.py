"""Compilation of scalar bodies into operators, and fusion of tensor code."""
