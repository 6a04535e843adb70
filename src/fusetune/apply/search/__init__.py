"""Searches the parameters that predict a vehicle's flights best, and says what they are worth on flights kept aside."""
