"""The charts of the pages: SVG that stands in the page itself, in its colours, light or dark."""
