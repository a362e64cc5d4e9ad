"""A small software renderer for glTF files: loading, rasterising and shading with numpy."""
