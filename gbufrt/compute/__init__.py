"""How a scalar body becomes an operator, and how tensor code is fused."""
