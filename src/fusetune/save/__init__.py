"""Third room: every log becomes a folder of tables with a verdict."""
