"""Compilation of scalar bodies into operators, and which of their forms runs."""
