"""Tells a robot which room it is in: subscribes pictures, publishes rooms."""
