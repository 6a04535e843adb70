"""What all pages have in common: head, policy, tabs, style, scripts, the words of the field."""
