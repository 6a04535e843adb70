"""Uploads tried on a vehicle in a process of its own that speaks MAVLink over loopback and is unkind."""
