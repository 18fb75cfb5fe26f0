"""Places on surfaces that paths come to, and how they answer light."""
