"""ULog files: reading them whatever their damage, and writing them."""
