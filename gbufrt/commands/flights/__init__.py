"""Flights: what is to be traced, how it is sampled, and the shots that it is cut into."""
