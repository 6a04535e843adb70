"""What ends a source, also where another source does it, as those of the releases until v1.14 do."""
