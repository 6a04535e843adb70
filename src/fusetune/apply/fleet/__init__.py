"""All flights together: how each figure of their health is spread, what changed when, which flights stand out."""
