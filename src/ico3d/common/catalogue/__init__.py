"""The table of pretrained weights that ico3d can use but does not ship."""
