"""Drawing of SVG: shapes, scales, axes, legends."""
