"""What people write into YAML files: how settings are declared, files read, and mistakes told."""
